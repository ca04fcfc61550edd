// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/evaluation/pose_error.hpp"

#include <numbers>
#include <vector>

#include <gtest/gtest.h>

namespace cairn {
namespace {

TEST(PoseError, IsZeroForTheTruth) {
  const auto pose = Rigid3::from_roll_pitch_yaw({1, 2, 3}, 0.1, 0.2, 0.3);
  const PoseError error = pose_error(pose, pose, {});
  EXPECT_NEAR(error.rotation_rad, 0.0, 1e-15);
  EXPECT_NEAR(error.translation, 0.0, 1e-15);
}

TEST(PoseError, MeasuresTranslationAtTheLandmarksAndNotAtTheOrigin) {
  // Both poses turn the landmarks about their own centroid, a kilometre from the origin.
  const Eigen::Vector3d centre(1000, 0, 0);
  const std::vector<Eigen::Vector3d> source = {centre + Eigen::Vector3d(1, 0, 0),
                                               centre - Eigen::Vector3d(1, 0, 0)};
  const Rigid3 to_centre(Eigen::Quaterniond::Identity(), centre);
  const auto turn = Rigid3::from_roll_pitch_yaw({0, 0, 0}, 0, 0, std::numbers::pi / 2);
  const PoseError error = pose_error(to_centre * turn * to_centre.inverse(), Rigid3(), source);
  EXPECT_NEAR(error.rotation_rad, std::numbers::pi / 2, 1e-12);
  EXPECT_NEAR(error.translation, 0.0, 1e-9);
}

TEST(PoseError, IsSymmetricInRotation) {
  const auto a = Rigid3::from_roll_pitch_yaw({0, 0, 0}, 0.1, 0.2, 0.3);
  const auto b = Rigid3::from_roll_pitch_yaw({0, 3, 4}, -0.3, 0.2, 0.1);
  EXPECT_NEAR(pose_error(a, b, {}).rotation_rad, pose_error(b, a, {}).rotation_rad, 1e-14);
  EXPECT_NEAR(pose_error(a, b, {}).translation, 5.0, 1e-14);
}

TEST(NormalisedSquaredError, CountsStandardDeviations) {
  const auto truth = Rigid3::from_roll_pitch_yaw({40, -30, 20}, 0.5, -0.7, 2.0);
  Matrix6d covariance = Matrix6d::Zero();
  covariance.diagonal() << 0.01, 0.04, 0.09, 1e-4, 4e-4, 9e-4;
  const Rigid3 found = truth.perturbed((Vector6d() << 0.2, 0.0, 0.3, 0.0, 0.02, 0.0).finished());
  EXPECT_NEAR(normalised_squared_error(found, covariance, truth), 4.0 + 1.0 + 1.0, 1e-9);
  EXPECT_EQ(normalised_squared_error(truth, covariance, truth), 0.0);
}

}  // namespace
}  // namespace cairn
