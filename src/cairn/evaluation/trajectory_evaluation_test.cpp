// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/evaluation/trajectory_evaluation.hpp"

#include <cmath>
#include <limits>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/core/error.hpp"
#include "cairn/core/random.hpp"

namespace cairn {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;

using Alignment = TrajectoryAlignment;

// A hand-held walk, 20 poses a second.
Trajectory path(int count = 200, double start_s = 100.0) {
  std::vector<TimedPose> poses;
  for (int i = 0; i < count; ++i) {
    const double t = 0.05 * i;
    poses.push_back(
        {start_s + t, Rigid3::from_roll_pitch_yaw({std::sin(t), 0.4 * t, 0.2 * std::cos(2.0 * t)},
                                                  0.1 * t, 0.2 * std::sin(t), 0.3 * t)});
  }
  return Trajectory(std::move(poses));
}

Trajectory noisy(const Trajectory& trajectory) {
  Random random(5);
  std::vector<TimedPose> poses(trajectory.poses().begin(), trajectory.poses().end());
  for (TimedPose& pose : poses) {
    pose.world_from_camera = pose.world_from_camera.perturbed(
        0.01 * Vector6d(Vector6d::NullaryExpr([&] { return random.normal(); })));
  }
  return Trajectory(std::move(poses));
}

TrajectoryEvaluation evaluated(const Trajectory& estimate, const Trajectory& truth,
                               Alignment alignment) {
  TrajectoryEvaluationOptions options;
  options.alignment = alignment;
  return evaluate_trajectory(estimate, truth, options);
}

const Similarity3 kWorldMotion(1.0, Rigid3::from_roll_pitch_yaw({5, -6, 7}, 1.0, 0.5, -2.0));

TEST(EvaluateTrajectory, IsZeroForTheTruthItself) {
  const Trajectory truth = path();
  for (const auto alignment :
       {Alignment::kNone, Alignment::kOrigin, Alignment::kSe3, Alignment::kSim3}) {
    const TrajectoryEvaluation result = evaluated(truth, truth, alignment);
    EXPECT_THAT(result.reason, IsEmpty());
    EXPECT_EQ(result.pairs.size(), truth.size());
    EXPECT_LT(result.absolute->translation.highest, 1e-9);
    for (const auto& relative : result.relative) EXPECT_LT(relative->translation.highest, 1e-9);
  }
}

TEST(EvaluateTrajectory, RigidMotionOfTheEstimateLeavesTheAlignedErrorsUnchanged) {
  const Trajectory truth = path();
  const Trajectory estimate = noisy(truth);
  const Trajectory moved = transformed(estimate, kWorldMotion);
  for (const auto alignment : {Alignment::kOrigin, Alignment::kSe3, Alignment::kSim3}) {
    const TrajectoryEvaluation here = evaluated(estimate, truth, alignment);
    const TrajectoryEvaluation there = evaluated(moved, truth, alignment);
    EXPECT_GT(here.absolute->translation.rmse, 0.005);
    EXPECT_NEAR(here.absolute->translation.rmse, there.absolute->translation.rmse, 1e-10);
    EXPECT_NEAR(here.absolute->rotation_rad.rmse, there.absolute->rotation_rad.rmse, 1e-7);
    for (std::size_t i = 0; i < here.relative.size(); ++i) {
      EXPECT_NEAR(here.relative[i]->translation.rmse, there.relative[i]->translation.rmse, 1e-10);
    }
  }
  EXPECT_GT(evaluated(moved, truth, Alignment::kNone).absolute->translation.rmse, 1.0);
}

TEST(EvaluateTrajectory, ScalingOfTheEstimateLeavesTheSim3ErrorsUnchanged) {
  const Trajectory truth = path();
  const Trajectory estimate = noisy(truth);
  const Trajectory scaled = transformed(estimate, Similarity3(7.5, kWorldMotion.rigid()));
  const TrajectoryEvaluation here = evaluated(estimate, truth, Alignment::kSim3);
  const TrajectoryEvaluation there = evaluated(scaled, truth, Alignment::kSim3);
  EXPECT_NEAR(here.absolute->translation.rmse, there.absolute->translation.rmse, 1e-10);
  EXPECT_NEAR(here.absolute->truth_from_estimate.scale(),
              7.5 * there.absolute->truth_from_estimate.scale(), 1e-10);
  for (std::size_t i = 0; i < here.relative.size(); ++i) {
    EXPECT_NEAR(here.relative[i]->translation.rmse, there.relative[i]->translation.rmse, 1e-10);
  }
  EXPECT_GT(evaluated(scaled, truth, Alignment::kSe3).relative[1]->translation.rmse, 0.5)
      << "seven times too long";
}

TEST(EvaluateTrajectory, Se3AlignmentHasTheLeastSquaredError) {
  const Trajectory truth = path();
  const Trajectory estimate = noisy(truth);
  const TrajectoryEvaluation best = evaluated(estimate, truth, Alignment::kSe3);
  const Similarity3& found = best.absolute->truth_from_estimate;
  for (int i = 0; i < 12; ++i) {
    Vector6d step = Vector6d::Zero();
    step[i / 2] = i % 2 == 0 ? 1e-3 : -1e-3;
    const Trajectory beside =
        transformed(estimate, Similarity3(1.0, found.rigid().perturbed(step)));
    EXPECT_GT(evaluated(beside, truth, Alignment::kNone).absolute->translation.rmse,
              best.absolute->translation.rmse);
  }
}

// Four corners of a square of 2 m, the third 0.4 m off along its diagonal. By hand: a square is no
// nearer to the displaced corners by turning, as the displacement points away from the centre, so the
// least squares only move the estimate by a quarter of it; 0.1 m is left at three corners, 0.3 m at
// the third.
TEST(EvaluateTrajectory, AgreesWithAWorkedExample) {
  const std::vector<Eigen::Vector3d> corners = {{-1, -1, 0}, {1, -1, 0}, {1, 1, 0}, {-1, 1, 0}};
  std::vector<TimedPose> true_poses;
  for (std::size_t i = 0; i < corners.size(); ++i) {
    true_poses.push_back(
        {static_cast<double>(i), Rigid3(Eigen::Quaterniond::Identity(), corners[i])});
  }
  std::vector<TimedPose> estimated_poses = true_poses;
  const Eigen::Vector3d off = Eigen::Vector3d(1, 1, 0).normalized() * 0.4;
  estimated_poses[2].world_from_camera = Rigid3(Eigen::Quaterniond::Identity(), corners[2] + off);
  const TrajectoryEvaluation result =
      evaluated(Trajectory(estimated_poses), Trajectory(true_poses), Alignment::kSe3);
  const ErrorStatistics& ate = result.absolute->translation;
  EXPECT_NEAR(ate.rmse, std::sqrt((3 * 0.01 + 0.09) / 4), 1e-12);
  EXPECT_NEAR(ate.mean, 0.15, 1e-12);
  EXPECT_NEAR(ate.median, 0.1, 1e-12);
  EXPECT_NEAR(ate.standard_deviation, std::sqrt(0.03 - 0.15 * 0.15), 1e-12);
  EXPECT_NEAR(ate.lowest, 0.1, 1e-12);
  EXPECT_NEAR(ate.highest, 0.3, 1e-12);
  // From one corner to the next: none, then 0.4 m there and 0.4 m back.
  const ErrorStatistics& frame = result.relative[2]->translation;
  EXPECT_EQ(frame.count, 3U);
  EXPECT_NEAR(frame.lowest, 0.0, 1e-12);
  EXPECT_NEAR(frame.median, 0.4, 1e-12);
  EXPECT_NEAR(frame.rmse, 0.4 * std::sqrt(2.0 / 3.0), 1e-12);
}

TEST(EvaluateTrajectory, SaysWhyThereIsNoAnswer) {
  EXPECT_THAT(
      evaluated(path(), path(200, 500.0), Alignment::kSe3).reason,
      HasSubstr("no pose of the estimate is within 0.02 s of a true one: the estimate lasts "
                "from 100.000 to 109.950 s, the truth lasts from 500.000"));
  EXPECT_THAT(evaluated(path(2), path(), Alignment::kSe3).reason,
              HasSubstr("2 of the poses paired; 3 are needed"));
  const Trajectory moving = path();
  std::vector<TimedPose> poses(moving.poses().begin(), moving.poses().end());
  for (TimedPose& pose : poses) pose.world_from_camera = Rigid3();
  const TrajectoryEvaluation none = evaluated(Trajectory(poses), path(), Alignment::kSim3);
  EXPECT_EQ(none.reason, "the poses determine no scale");
  EXPECT_FALSE(none.absolute);
  EXPECT_EQ(none.relative.size(), 3U);
}

TEST(EvaluateTrajectory, RelativeErrorsNeedATrajectoryAsLongAsTheInterval) {
  const TrajectoryEvaluation result = evaluated(path(5), path(5), Alignment::kSe3);
  EXPECT_FALSE(result.relative[0]);
  EXPECT_FALSE(result.relative[1]);
  EXPECT_TRUE(result.relative[2]);
}

TEST(EvaluateTrajectory, RefusesOptionsByName) {
  TrajectoryEvaluationOptions options;
  for (const double wrong : {0.0, -1.0, std::numeric_limits<double>::quiet_NaN()}) {
    options.max_time_difference_s = wrong;
    EXPECT_THROW(evaluate_trajectory(path(), path(), options), Error);
  }
  options = {};
  options.intervals = {{RelativeInterval::Unit::kFrames, 1.5}};
  EXPECT_THROW(evaluate_trajectory(path(), path(), options), Error);
}

}  // namespace
}  // namespace cairn
