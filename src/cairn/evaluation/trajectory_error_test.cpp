// SPDX-License-Identifier: BSD-3-Clause
#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "cairn/core/error.hpp"
#include "cairn/core/random.hpp"
#include "cairn/evaluation/trajectory_evaluation.hpp"

namespace cairn {
namespace {

constexpr double kStep = 0.1;

// A path that turns and climbs, a pose each 0.1 s.
Trajectory curve(int count = 50) {
  std::vector<TimedPose> poses;
  for (int i = 0; i < count; ++i) {
    const double t = kStep * i;
    poses.push_back({10.0 + t, Rigid3::from_roll_pitch_yaw({t, std::sin(t), 0.1 * t * t}, 0.1 * t,
                                                           0.2 * std::sin(t), 0.3 * t)});
  }
  return Trajectory(std::move(poses));
}

Trajectory changed(const Trajectory& trajectory, auto&& change) {
  std::vector<TimedPose> poses(trajectory.poses().begin(), trajectory.poses().end());
  for (TimedPose& pose : poses) pose.world_from_camera = change(pose.world_from_camera);
  return Trajectory(std::move(poses));
}

PosePairs all(const Trajectory& trajectory) {
  PosePairs pairs;
  for (std::size_t i = 0; i < trajectory.size(); ++i) pairs.emplace_back(i, i);
  return pairs;
}

TEST(AbsoluteError, IsBlindToWhatTheAlignmentRemoves) {
  const Trajectory truth = curve();
  const auto shift = Rigid3::from_roll_pitch_yaw({5, -6, 7}, 1.0, 0.5, -2.0);
  const Trajectory moved = changed(truth, [&](const Rigid3& pose) { return shift * pose; });
  for (const auto alignment :
       {TrajectoryAlignment::kOrigin, TrajectoryAlignment::kSe3, TrajectoryAlignment::kSim3}) {
    const auto error = absolute_error(moved, truth, all(truth), alignment);
    ASSERT_TRUE(error);
    EXPECT_LT(error->translation.rmse, 1e-9);
    EXPECT_LT(error->rotation_rad.rmse, 1e-7);
  }
  EXPECT_GT(absolute_error(moved, truth, all(truth), TrajectoryAlignment::kNone)->translation.rmse,
            1);

  const Trajectory scaled = changed(truth, [](const Rigid3& pose) {
    return Rigid3(pose.quaternion(), 3.0 * pose.translation());
  });
  const auto sim3 = absolute_error(scaled, truth, all(truth), TrajectoryAlignment::kSim3);
  EXPECT_LT(sim3->translation.rmse, 1e-9);
  EXPECT_NEAR(sim3->truth_from_estimate.scale(), 1.0 / 3.0, 1e-12);
  EXPECT_GT(absolute_error(scaled, truth, all(truth), TrajectoryAlignment::kSe3)->translation.rmse,
            0.5);
}

TEST(AbsoluteError, MeasuresAKnownOffset) {
  const Trajectory truth = curve();
  const Trajectory off = changed(truth, [](const Rigid3& pose) {
    return pose.perturbed((Vector6d() << 0.03, 0.04, 0, 0, 0, 0.1).finished());
  });
  const auto error = absolute_error(off, truth, all(truth), TrajectoryAlignment::kNone);
  EXPECT_NEAR(error->translation.rmse, 0.05, 1e-12);
  EXPECT_NEAR(error->translation.standard_deviation, 0.0, 1e-12);
  EXPECT_NEAR(error->rotation_rad.mean, 0.1, 1e-12);
}

TEST(AbsoluteError, NeedsEnoughPairs) {
  const Trajectory truth = curve(2);
  EXPECT_FALSE(absolute_error(truth, truth, all(truth), TrajectoryAlignment::kSe3));
  EXPECT_FALSE(absolute_error(truth, truth, {}, TrajectoryAlignment::kNone));
  EXPECT_TRUE(absolute_error(truth, truth, all(truth), TrajectoryAlignment::kOrigin));
  const Trajectory still = changed(curve(), [](const Rigid3&) { return Rigid3(); });
  EXPECT_FALSE(absolute_error(still, curve(), all(still), TrajectoryAlignment::kSim3))
      << "a point has no scale";
  EXPECT_TRUE(absolute_error(still, curve(), all(still), TrajectoryAlignment::kSe3));
}

TEST(RelativeError, DoesNotDependOnTheFramesOfEither) {
  Random random(1);
  const Trajectory truth = curve();
  const Trajectory noisy = changed(truth, [&](const Rigid3& pose) {
    return pose.perturbed(0.01 * Vector6d(Vector6d::NullaryExpr([&] { return random.normal(); })));
  });
  const auto shift = Rigid3::from_roll_pitch_yaw({5, -6, 7}, 1.0, 0.5, -2.0);
  const Trajectory moved = changed(noisy, [&](const Rigid3& pose) { return shift * pose; });
  const auto here = relative_error(noisy, truth, all(truth), {});
  const auto there = relative_error(moved, truth, all(truth), {});
  EXPECT_NEAR(here->translation.rmse, there->translation.rmse, 1e-12);
  EXPECT_NEAR(here->rotation_rad.rmse, there->rotation_rad.rmse, 1e-7);
}

TEST(RelativeError, IsTheDriftOverTheInterval) {
  // Straight ahead; the estimate is 2 % too long and turns by 0.01 rad a second.
  std::vector<TimedPose> true_poses;
  std::vector<TimedPose> estimated_poses;
  for (int i = 0; i <= 40; ++i) {
    const double t = 0.25 * i;  // exact in binary
    true_poses.push_back({t, Rigid3(Eigen::Quaterniond::Identity(), {0, 0, 2.0 * t})});
    estimated_poses.push_back({t, Rigid3::from_roll_pitch_yaw({0, 0, 2.04 * t}, 0, 0, 0.01 * t)});
  }
  const Trajectory truth{true_poses};
  const Trajectory estimate{estimated_poses};
  const auto second = relative_error(estimate, truth, all(truth), {});
  EXPECT_EQ(second->translation.count, 37U);
  EXPECT_NEAR(second->translation.mean, 0.04, 1e-12);
  EXPECT_NEAR(second->rotation_rad.mean, 0.01, 1e-12);
  const auto metre =
      relative_error(estimate, truth, all(truth), {RelativeInterval::Unit::kMetres, 1.0});
  EXPECT_NEAR(metre->translation.mean, 0.02, 1e-12);
  const auto frame =
      relative_error(estimate, truth, all(truth), {RelativeInterval::Unit::kFrames, 2.0});
  EXPECT_NEAR(frame->translation.mean, 0.02, 1e-12);
}

TEST(RelativeError, ReachesToThePoseNearestToTheInterval) {
  // A second after 0 the nearest pose is that at 0.9; a second after 0.3, that at 1.25.
  std::vector<TimedPose> poses;
  std::vector<TimedPose> drifting;
  for (const double t : {0.0, 0.3, 0.9, 1.25, 1.4}) {
    poses.push_back({t, Rigid3(Eigen::Quaterniond::Identity(), {t, 0, 0})});
    drifting.push_back({t, Rigid3(Eigen::Quaterniond::Identity(), {1.1 * t, 0, 0})});
  }
  const Trajectory truth{poses};
  const auto error = relative_error(Trajectory{drifting}, truth, all(truth), {});
  EXPECT_EQ(error->translation.count, 2U) << "0.9 + 1 is beyond the end";
  EXPECT_NEAR(error->translation.lowest, 0.09, 1e-12);
  EXPECT_NEAR(error->translation.highest, 0.095, 1e-12);
}

TEST(RelativeError, IsUnknownWhereNothingIsAnIntervalApart) {
  const Trajectory truth = curve(5);
  EXPECT_FALSE(relative_error(truth, truth, all(truth), {}));
  EXPECT_THROW(relative_error(truth, truth, all(truth), {RelativeInterval::Unit::kSeconds, 0.0}),
               Error);
}

}  // namespace
}  // namespace cairn
