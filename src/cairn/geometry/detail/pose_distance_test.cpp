// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/geometry/detail/pose_distance.hpp"

#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "cairn/core/random.hpp"
#include "cairn/geometry/rigid3.hpp"

namespace cairn {
namespace {

// On a sphere about a point.
std::vector<Eigen::Vector3d> sphere(const Eigen::Vector3d& centre, double radius) {
  Random random(3);
  std::vector<Eigen::Vector3d> points;
  for (int i = 0; i < 5000; ++i) {
    const Eigen::Vector3d direction(random.normal(), random.normal(), random.normal());
    points.emplace_back(centre + radius * direction.normalized());
  }
  return points;
}

TEST(PoseDistance, IsTheRootMeanSquareDistanceOfThePointsOfABall) {
  const auto points = sphere({4.0, -2.0, 1.0}, 0.7);
  const PoseDistance distance = PoseDistance::of(points);
  EXPECT_NEAR(distance.radius, 0.7, 1e-3);
  const Rigid3 a(rotation_exp({0.3, 0.1, -0.2}), {1.0, 0.0, 2.0});
  const Rigid3 b(rotation_exp({-0.5, 0.4, 0.6}), {1.5, 0.2, 1.0});
  double sum = 0.0;
  for (const auto& point : points) sum += (a * point - b * point).squaredNorm();
  EXPECT_NEAR(distance(a, b), std::sqrt(sum / static_cast<double>(points.size())), 0.02);
  EXPECT_EQ(distance(a, b), distance(b, a));
}

TEST(PoseDistance, CountsADifferenceOfScale) {
  const auto points = sphere({4.0, -2.0, 1.0}, 0.7);
  const PoseDistance distance = PoseDistance::of(points);
  const Similarity3 a(1.7, {rotation_exp({0.3, 0.1, -0.2}), {1.0, 0.0, 2.0}});
  const Similarity3 b(0.6, {rotation_exp({-0.5, 0.4, 0.6}), {1.5, 0.2, 1.0}});
  double sum = 0.0;
  for (const auto& point : points) sum += (a * point - b * point).squaredNorm();
  EXPECT_NEAR(distance(a, b), std::sqrt(sum / static_cast<double>(points.size())), 0.02);
}

TEST(PoseDistance, OfATranslationIsItsLengthAndOfOnePoseNothing) {
  const PoseDistance distance{{5.0, 5.0, 5.0}, 2.0};
  const Rigid3 pose(rotation_exp({0.0, 1.0, 0.0}), {1.0, 2.0, 3.0});
  const Rigid3 moved(pose.quaternion(), pose.translation() + Eigen::Vector3d(0.0, 3.0, 4.0));
  EXPECT_NEAR(distance(pose, moved), 5.0, 1e-12);
  EXPECT_NEAR(distance(pose, pose), 0.0, 1e-12);
}

}  // namespace
}  // namespace cairn
