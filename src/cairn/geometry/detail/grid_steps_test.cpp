// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/geometry/detail/grid_steps.hpp"

#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "cairn/core/random.hpp"

namespace cairn::detail {
namespace {

// Random positions of which the first coordinates are rounded to their steps.
std::vector<Eigen::Vector3d> rounded(const std::vector<double>& steps, std::size_t count) {
  Random random(1);
  std::vector<Eigen::Vector3d> positions;
  for (std::size_t i = 0; i < count; ++i) {
    Eigen::Vector3d position(random.uniform(0, 2), random.uniform(0, 2), random.uniform(0, 2));
    for (std::size_t axis = 0; axis < steps.size(); ++axis) {
      double& x = position[static_cast<Eigen::Index>(axis)];
      x = steps[axis] * std::round(x / steps[axis]);
    }
    positions.push_back(position);
  }
  return positions;
}

TEST(GridSteps, AreThoseOfEachCoordinateIfTwoHaveOne) {
  for (const std::size_t count : {500U, 20'000U}) {
    EXPECT_TRUE(
        grid_steps(rounded({0.05, 0.1, 0.2}, count)).isApprox(Eigen::Vector3d(0.05, 0.1, 0.2)));
    EXPECT_TRUE(grid_steps(rounded({0.05, 0.1}, count)).isApprox(Eigen::Vector3d(0.05, 0.1, 0.0)));
    EXPECT_EQ(grid_steps(rounded({0.05}, count)), Eigen::Vector3d(Eigen::Vector3d::Zero()));
  }
  EXPECT_EQ(grid_steps({}), Eigen::Vector3d(Eigen::Vector3d::Zero()));
}

}  // namespace
}  // namespace cairn::detail
