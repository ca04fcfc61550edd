// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/evaluation/hand_eye.hpp"

#include <cmath>
#include <utility>
#include <vector>

#include <Eigen/Cholesky>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/core/error.hpp"
#include "cairn/core/random.hpp"
#include "cairn/evaluation/trajectory_evaluation.hpp"
#include "cairn/geometry/angles.hpp"
#include "cairn/geometry/covariance.hpp"

namespace cairn {
namespace {

using ::testing::HasSubstr;

// Where a hand-held camera is.
Rigid3 camera_at(double t) {
  return Rigid3::from_roll_pitch_yaw({std::sin(t), 0.4 * t, 0.2 * std::cos(2.0 * t)},
                                     0.4 * std::sin(1.3 * t), 0.3 * std::sin(0.7 * t), 0.3 * t);
}

struct Scene {
  Trajectory estimate;
  Trajectory truth;
};

// The truth at 100 poses a second is of a body and another clock; the estimate, at 20, in another world.
Scene scene(const Rigid3& body_from_camera, double clock_offset_s, double noise,
            std::uint64_t seed = 1, double scale = 1.0) {
  Random random(seed);
  const auto noisy = [&](const Rigid3& pose, double metres, double rad) {
    Vector6d step;
    for (int i = 0; i < 6; ++i) step[i] = (i < 3 ? metres : rad) * random.normal();
    return pose.perturbed(step);
  };
  std::vector<TimedPose> truth;
  for (int i = 0; i < 2200; ++i) {
    const double t = 0.01 * i - 1.0;
    truth.push_back({t + clock_offset_s,
                     noisy(camera_at(t) * body_from_camera.inverse(), 0.2 * noise, 0.2 * noise)});
  }
  const Rigid3 world = Rigid3::from_roll_pitch_yaw({5, -6, 7}, 1.0, 0.5, -2.0);
  std::vector<TimedPose> estimate;
  for (int i = 0; i < 400; ++i) {
    const double t = 0.05 * i + 0.003;
    estimate.push_back({t, noisy(world * camera_at(t), noise, 0.5 * noise)});
  }
  return {transformed(Trajectory(std::move(estimate)), Similarity3(scale, Rigid3())),
          Trajectory(std::move(truth))};
}

const Rigid3 kOffset =
    Rigid3::from_roll_pitch_yaw({0.01, -0.006, 0.004}, radians(1.5), radians(-0.4), radians(0.3));

TEST(HandEye, FindsAnExactOffset) {
  for (const Rigid3& offset :
       {kOffset, Rigid3(), Rigid3::from_roll_pitch_yaw({0.3, 0.1, -0.2}, 1.5, 0.2, -2.5)}) {
    for (const double clock : {0.0, 0.037, -0.1}) {
      const Scene exact = scene(offset, clock, 0.0);
      const HandEyeResult result = estimate_hand_eye(exact.estimate, exact.truth);
      ASSERT_TRUE(result.hand_eye) << result.reason;
      const Vector6d off = offset.difference_to(result.hand_eye->body_from_camera);
      // Of the truth's interpolation.
      EXPECT_LT(off.head<3>().norm(), 2e-4);
      EXPECT_LT(off.tail<3>().norm(), 2e-4);
      EXPECT_NEAR(result.hand_eye->clock_offset_s, clock, 2e-4);
    }
  }
}

TEST(HandEye, FindsTheScaleIfAsked) {
  const Scene exact = scene(kOffset, 0.0, 0.0, 1, 4.0);
  const HandEyeResult result =
      estimate_hand_eye(exact.estimate, exact.truth, kMaxClockOffset, true);
  ASSERT_TRUE(result.hand_eye);
  EXPECT_NEAR(result.hand_eye->truth_from_estimate.scale(), 0.25, 1e-4);
  EXPECT_LT(kOffset.difference_to(result.hand_eye->body_from_camera).norm(), 5e-4);
}

TEST(HandEye, StatesHowUncertainItIs) {
  double sum = 0.0;
  double clock = 0.0;
  constexpr int kRuns = 20;
  for (int run = 0; run < kRuns; ++run) {
    const Scene noisy = scene(kOffset, 0.02, 0.01, static_cast<std::uint64_t>(run) + 1);
    const HandEyeResult result = estimate_hand_eye(noisy.estimate, noisy.truth);
    ASSERT_TRUE(result.hand_eye);
    const HandEye& found = *result.hand_eye;
    sum += normalised_squared_error(found.body_from_camera, found.covariance, kOffset);
    const double off = (found.clock_offset_s - 0.02) / found.clock_offset_deviation_s;
    clock += off * off;
  }
  // 6 and 1 if they were known; with covariances from 15 parts somewhat more.
  EXPECT_GT(sum / kRuns, 2.5);
  EXPECT_LT(sum / kRuns, 18.0);
  EXPECT_GT(clock / kRuns, 0.3);
  EXPECT_LT(clock / kRuns, 3.0);
}

TEST(HandEye, CorrectedTruthLeavesTheNoiseOnly) {
  const Scene noisy = scene(kOffset, 0.05, 0.005);
  const HandEyeResult result = estimate_hand_eye(noisy.estimate, noisy.truth);
  ASSERT_TRUE(result.hand_eye);
  TrajectoryEvaluationOptions options;
  options.alignment = TrajectoryAlignment::kPoses;
  const auto before = evaluate_trajectory(noisy.estimate, noisy.truth, options);
  const auto after =
      evaluate_trajectory(noisy.estimate, corrected_truth(noisy.truth, *result.hand_eye), options);
  EXPECT_LT(after.absolute->rotation_rad.rmse, 0.5 * before.absolute->rotation_rad.rmse);
  EXPECT_LT(after.absolute->translation.rmse, 0.5 * before.absolute->translation.rmse);
  EXPECT_NEAR(after.absolute->translation.rmse, std::sqrt(3.0) * 0.005, 0.002);
}

TEST(HandEye, AFewWrongPosesHardlyCount) {
  Scene noisy = scene(kOffset, 0.0, 0.003);
  std::vector<TimedPose> poses(noisy.estimate.poses().begin(), noisy.estimate.poses().end());
  for (std::size_t i = 100; i < 120; ++i) {
    poses[i].world_from_camera =
        Rigid3::from_roll_pitch_yaw({1, 2, 3}, 0.3, 0.1, 0.2) * poses[i].world_from_camera;
  }
  const HandEyeResult result = estimate_hand_eye(Trajectory(std::move(poses)), noisy.truth);
  ASSERT_TRUE(result.hand_eye);
  EXPECT_LT(kOffset.difference_to(result.hand_eye->body_from_camera).tail<3>().norm(),
            radians(0.3));
}

TEST(HandEye, SaysWhereTheMotionDoesNotDetermineIt) {
  std::vector<TimedPose> poses;
  for (int i = 0; i < 300; ++i) {
    const double t = 0.05 * i;
    poses.push_back({t, Rigid3::from_roll_pitch_yaw({std::sin(t), t, 0.0}, 0.0, 0.0, 0.4 * t)});
  }
  const Trajectory planar(std::move(poses));
  const HandEyeResult result = estimate_hand_eye(planar, planar);
  EXPECT_FALSE(result.hand_eye);
  EXPECT_THAT(result.reason, HasSubstr("does not determine"));
}

TEST(HandEye, SaysWhereTooFewPosesAreNearInTime) {
  const Scene exact = scene(kOffset, 50.0, 0.0);
  const HandEyeResult result = estimate_hand_eye(exact.estimate, exact.truth);
  EXPECT_FALSE(result.hand_eye);
  EXPECT_THAT(result.reason, HasSubstr("poses of the estimate"));
  EXPECT_FALSE(estimate_hand_eye(Trajectory(), Trajectory()).hand_eye);
}

TEST(HandEye, RefusesOptionsOutsideTheirRange) {
  EXPECT_THROW(estimate_hand_eye(Trajectory(), Trajectory(), -1.0), Error);
}

}  // namespace
}  // namespace cairn
