// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/vision/detail/corrected_trajectory.hpp"

#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "support/refusal.hpp"

namespace cairn::detail {
namespace {

using ::testing::HasSubstr;

Rigid3 along_x(double x, double yaw = 0.0) {
  return Rigid3::from_roll_pitch_yaw({x, 0.0, 0.0}, 0.0, 0.0, yaw);
}

void expect_pose(const Rigid3& pose, const Rigid3& expected) {
  EXPECT_LT(pose.difference_to(expected).norm(), 1e-12);
}

TEST(CorrectedTrajectory, KeyframesGetTheirNewPosesAndOthersWhatLiesBetween) {
  const Trajectory path(
      {{1.0, along_x(0.0)}, {2.0, along_x(1.0)}, {3.0, along_x(2.0)}, {5.0, along_x(4.0)}});
  // The second keyframe moved by 0.4 m along the path.
  const std::vector<CorrectedKeyframe> keyframes = {{1.0, along_x(0.0), along_x(0.0)},
                                                    {5.0, along_x(4.0), along_x(4.4)}};
  const Trajectory now = corrected(path, keyframes);
  ASSERT_EQ(now.size(), 4U);
  expect_pose(now.poses()[0].world_from_camera, along_x(0.0));
  expect_pose(now.poses()[1].world_from_camera, along_x(1.1));
  expect_pose(now.poses()[2].world_from_camera, along_x(2.2));
  expect_pose(now.poses()[3].world_from_camera, along_x(4.4));
  EXPECT_EQ(now.poses()[2].timestamp_s, 3.0);
}

TEST(CorrectedTrajectory, PosesTurnWithTheirKeyframe) {
  const Trajectory path({{1.0, along_x(1.0)}, {2.0, along_x(2.0)}, {3.0, along_x(3.0)}});
  // Turned about the origin by a right angle, the pose two metres ahead of the keyframe goes to (1, 2).
  const std::vector<CorrectedKeyframe> keyframes = {
      {1.0, along_x(1.0), along_x(1.0, 1.5707963267948966)}};
  const Trajectory now = corrected(path, keyframes);
  const Eigen::Vector3d end = now.poses()[2].world_from_camera.translation();
  EXPECT_LT((end - Eigen::Vector3d(1.0, 2.0, 0.0)).norm(), 1e-12);
}

TEST(CorrectedTrajectory, BeforeTheFirstAndAfterTheLastKeyframeTheNearestDecides) {
  const Trajectory path(
      {{0.0, along_x(0.0)}, {1.0, along_x(1.0)}, {2.0, along_x(2.0)}, {3.0, along_x(3.0)}});
  const std::vector<CorrectedKeyframe> keyframes = {{1.0, along_x(1.0), along_x(1.5)},
                                                    {2.0, along_x(2.0), along_x(2.1)}};
  const Trajectory now = corrected(path, keyframes);
  expect_pose(now.poses()[0].world_from_camera, along_x(0.5));
  expect_pose(now.poses()[3].world_from_camera, along_x(3.1));
}

TEST(CorrectedTrajectory, RefusesKeyframesOutOfOrder) {
  const Trajectory path({{0.0, along_x(0.0)}});
  const auto reason = [&](const std::vector<CorrectedKeyframe>& keyframes) {
    return testing::refusal(ErrorKind::kMisuse, [&] { corrected(path, keyframes); });
  };
  EXPECT_THAT(reason({}), HasSubstr("none"));
  EXPECT_THAT(reason({{1.0, along_x(0.0), along_x(0.0)}, {1.0, along_x(0.0), along_x(0.0)}}),
              HasSubstr("1.000000 s after 1.000000 s"));
}

}  // namespace
}  // namespace cairn::detail
