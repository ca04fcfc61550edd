// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/geometry/detail/central_part.hpp"

#include <vector>

#include <gtest/gtest.h>

#include "cairn/core/random.hpp"
#include "cairn/geometry/detail/centroid.hpp"

namespace cairn {
namespace {

std::vector<Eigen::Vector3d> scattered_points(std::size_t count) {
  Random random(4);
  std::vector<Eigen::Vector3d> points;
  for (std::size_t i = 0; i < count; ++i) {
    points.emplace_back(random.uniform(), 10.0 + random.uniform(), -3.0 * random.uniform());
  }
  return points;
}

TEST(CentralPart, IsTheCentroidToTheBitWithoutFarOutliers) {
  std::vector<Eigen::Vector3d> points = scattered_points(999);
  EXPECT_EQ(central_part(points).centre, centroid(points));
  points.emplace_back(20.0, 0.0, 0.0);  // an outlier that any map may have
  EXPECT_EQ(central_part(points).centre, centroid(points));
}

TEST(CentralPart, IsNotDecidedByFarOutliers) {
  std::vector<Eigen::Vector3d> points = scattered_points(999);
  const CentralPart without = central_part(points);
  points.emplace(points.begin() + 10, 1e9, 0.0, -1e9);
  points.emplace_back(0.0, 1e5, 0.0);
  EXPECT_EQ(central_part(points).centre, without.centre);
  EXPECT_EQ(central_part(points).radius, without.radius);
  EXPECT_LT(without.radius, 2.0);
}

TEST(CentralPart, ExistsForFewPointsAndForSomeThatCoincide) {
  EXPECT_EQ(central_part({}).centre, Eigen::Vector3d::Zero());
  const std::vector<Eigen::Vector3d> one = {{1.0, 2.0, 3.0}};
  EXPECT_EQ(central_part(one).centre, one[0]);
  EXPECT_EQ(central_part(one).radius, 0.0);
  const std::vector<Eigen::Vector3d> two = {{0.0, 0.0, 0.0}, {2.0, 0.0, 0.0}};
  EXPECT_EQ(central_part(two).centre, Eigen::Vector3d(1.0, 0.0, 0.0));
  EXPECT_EQ(central_part(two).radius, 1.0);
  const std::vector<Eigen::Vector3d> same = {{1, 1, 1}, {1, 1, 1}, {1, 1, 1}, {5, 1, 1}};
  EXPECT_EQ(central_part(same).centre, Eigen::Vector3d(2.0, 1.0, 1.0));
}

}  // namespace
}  // namespace cairn
