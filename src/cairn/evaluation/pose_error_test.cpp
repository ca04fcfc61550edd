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

TEST(PoseError, CountsAScaleTwiceAndHalfAsLargeAlike) {
  const Similarity3 truth(0.5, Rigid3(Eigen::Quaterniond::Identity(), {1, 0, 0}));
  const std::vector<Eigen::Vector3d> source = {{0, 0, 4}};
  const PoseError larger = pose_error(Similarity3(1.0, truth.rigid()), truth, source);
  EXPECT_NEAR(larger.log_scale, std::numbers::ln2, 1e-15);
  EXPECT_NEAR(larger.translation, 2.0, 1e-15) << "from 2 m to 4 m away";
  const PoseError smaller = pose_error(Similarity3(0.25, truth.rigid()), truth, source);
  EXPECT_NEAR(smaller.log_scale, std::numbers::ln2, 1e-15);
  EXPECT_NEAR(smaller.translation, 1.0, 1e-15);
  EXPECT_EQ(pose_error(truth, truth, source).log_scale, 0.0);
}

class SwappedTruth : public ::testing::Test {
 protected:
  const std::vector<Eigen::Vector3d> source_ = {{5, 0, 0},  {7, 0, 0}, {6, 1, 0},
                                                {6, -1, 0}, {6, 0, 1}, {6, 0, -1}};
  const Rigid3 truth_ = Rigid3::from_roll_pitch_yaw({1, 2, 3}, 0.1, 0.2, 0.9);
  const Rigid3 near_ = Rigid3::from_roll_pitch_yaw({0.01, -0.01, 0.02}, 0.001, 0.0, -0.002);
};

TEST_F(SwappedTruth, IsNoticedWhereItsInverseFits) {
  EXPECT_TRUE(fits_inverse(near_ * truth_, truth_.inverse(), source_));
  EXPECT_FALSE(fits_inverse(near_ * truth_, truth_, source_));
  const Similarity3 scaled(3.0, truth_);
  EXPECT_TRUE(fits_inverse(scaled, scaled.inverse(), source_));
  EXPECT_FALSE(fits_inverse(scaled, scaled, source_));
}

TEST_F(SwappedTruth, IsNoExplanationOfAPoseThatIsWrongAnyhow) {
  const Rigid3 wrong = Rigid3::from_roll_pitch_yaw({0, 0, 2}, 2.0, 0.0, 0.0);
  EXPECT_FALSE(fits_inverse(wrong, truth_, source_));
  EXPECT_FALSE(fits_inverse(wrong * truth_, truth_.inverse(), source_));
}

TEST_F(SwappedTruth, DoesNotMatterWhereThePoseFitsBothWays) {
  const Rigid3 small = Rigid3::from_roll_pitch_yaw({0.01, 0, 0}, 0, 0, 0.001);
  EXPECT_FALSE(fits_inverse(small.inverse(), small, source_));
  EXPECT_FALSE(fits_inverse(small, small, {}));
}

TEST(PoseError, IsSymmetricInRotation) {
  const auto a = Rigid3::from_roll_pitch_yaw({0, 0, 0}, 0.1, 0.2, 0.3);
  const auto b = Rigid3::from_roll_pitch_yaw({0, 3, 4}, -0.3, 0.2, 0.1);
  EXPECT_NEAR(pose_error(a, b, {}).rotation_rad, pose_error(b, a, {}).rotation_rad, 1e-14);
  EXPECT_NEAR(pose_error(a, b, {}).translation, 5.0, 1e-14);
}

}  // namespace
}  // namespace cairn
