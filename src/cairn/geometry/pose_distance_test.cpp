// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/geometry/pose_distance.hpp"

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

TEST(PoseDistance, OfATranslationIsItsLengthAndOfOnePoseNothing) {
  const PoseDistance distance{{5.0, 5.0, 5.0}, 2.0};
  const Rigid3 pose(rotation_exp({0.0, 1.0, 0.0}), {1.0, 2.0, 3.0});
  const Rigid3 moved(pose.quaternion(), pose.translation() + Eigen::Vector3d(0.0, 3.0, 4.0));
  EXPECT_NEAR(distance(pose, moved), 5.0, 1e-12);
  EXPECT_NEAR(distance(pose, pose), 0.0, 1e-12);
}

TEST(NormalisedSquaredError, CountsStandardDeviations) {
  const auto truth = Rigid3::from_roll_pitch_yaw({40, -30, 20}, 0.5, -0.7, 2.0);
  Matrix6d covariance = Matrix6d::Zero();
  covariance.diagonal() << 0.01, 0.04, 0.09, 1e-4, 4e-4, 9e-4;
  const Rigid3 found = truth.perturbed((Vector6d() << 0.2, 0.0, 0.3, 0.0, 0.02, 0.0).finished());
  EXPECT_NEAR(normalised_squared_error(found, covariance, truth), 4.0 + 1.0 + 1.0, 1e-9);
  EXPECT_EQ(normalised_squared_error(truth, covariance, truth), 0.0);
}

TEST(NormalisedSquaredError, IsTheSameInOtherAxes) {
  Random random(5);
  Eigen::Matrix<double, 6, 6> mix;
  for (int i = 0; i < 36; ++i) mix(i / 6, i % 6) = random.normal();
  Vector6d error;
  for (int i = 0; i < 6; ++i) error[i] = 1e-3 * random.normal();
  const Eigen::Matrix<double, 6, 1> mixed = 1e-3 * mix * Eigen::Matrix<double, 6, 1>(error);
  const Rigid3 pose = Rigid3::from_roll_pitch_yaw({1, 2, 3}, 0.1, 0.2, 0.3);
  const double plain =
      normalised_squared_error(pose, Matrix6d::Identity(), pose.perturbed(1e-3 * error));
  EXPECT_NEAR(normalised_squared_error(pose, mix * mix.transpose(), pose.perturbed(mixed)), plain,
              1e-6 * plain);
}

TEST(InverseCovariance, IsThatOfTheInvertedPerturbations) {
  const Rigid3 pose = Rigid3::from_roll_pitch_yaw({1, -2, 3}, 0.4, -0.2, 1.3);
  constexpr double kStep = 1e-6;
  Matrix6d jacobian;
  for (int i = 0; i < 6; ++i) {
    const Rigid3 moved = pose.perturbed(kStep * Vector6d::Unit(i));
    jacobian.col(i) = pose.inverse().difference_to(moved.inverse()) / kStep;
  }
  Matrix6d covariance = Matrix6d::Identity();
  covariance(0, 4) = covariance(4, 0) = 0.5;
  const Matrix6d expected = jacobian * covariance * jacobian.transpose();
  EXPECT_LT((inverse_covariance(pose, covariance) - expected).norm(), 1e-4);
  EXPECT_LT((inverse_covariance(pose.inverse(), inverse_covariance(pose, covariance)) - covariance)
                .norm(),
            1e-9);
}

}  // namespace
}  // namespace cairn
