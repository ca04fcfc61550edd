// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/geometry/detail/centroid.hpp"

#include <vector>

#include <gtest/gtest.h>

#include "cairn/geometry/angles.hpp"

namespace cairn {
namespace {

TEST(Centroid, IsTheMeanOfThePoints) {
  const std::vector<Eigen::Vector3d> points = {{1, 2, 3}, {3, 2, 1}, {2, 5, -1}};
  EXPECT_TRUE(centroid(points).isApprox(Eigen::Vector3d(2, 3, 1), 1e-15));
}

TEST(Centroid, OfNoPointsIsTheOrigin) {
  EXPECT_EQ(centroid({}), Eigen::Vector3d::Zero());
}

TEST(Angles, OfHalfATurn) {
  EXPECT_EQ(degrees(std::numbers::pi), 180.0);
  EXPECT_EQ(radians(180.0), std::numbers::pi);
}

}  // namespace
}  // namespace cairn
