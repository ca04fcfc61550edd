// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <optional>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/core/error.hpp"
#include "cairn/evaluation/covariance_calibration.hpp"
#include "cairn/vision/map_sequence.hpp"

#include "recording.hpp"

namespace cairn::testing {
namespace {

using ::testing::HasSubstr;

std::vector<double> times_of(const Recording& recording) {
  std::vector<double> times;
  for (const FrameImages& frame : recording.frames) times.push_back(frame.timestamp_s);
  return times;
}

MapAtPoses map_of(const Recording& recording, const Trajectory& poses,
                  const MapAtPosesOptions& options = MapAtPosesOptions(),
                  const Execution& execution = {}) {
  return map_at_poses(times_of(recording), recording, poses, recording.camera, options, execution);
}

const MapAtPoses& sweep_map() {
  static const MapAtPoses map = map_of(sweep(), sweep().truth);
  return map;
}

// Every nth pose, its time off by so much.
Trajectory every_nth(const Trajectory& trajectory, std::size_t n, double late_s) {
  std::vector<TimedPose> poses;
  for (std::size_t i = 0; i < trajectory.size(); i += n) {
    const TimedPose& pose = trajectory.poses()[i];
    poses.push_back({pose.timestamp_s + late_s, pose.world_from_camera});
  }
  return Trajectory(std::move(poses));
}

// The surface point that a pixel shows; nothing where another surface is next to it.
std::optional<Eigen::Vector3d> true_point(const Recording& recording, std::size_t frame,
                                          const Pixel& pixel) {
  const auto width = static_cast<int>(recording.camera.width);
  const int x = static_cast<int>(pixel.u);
  const int y = static_cast<int>(pixel.v);
  const std::vector<float>& depths = recording.exact_depths_m[frame];
  const auto at = [&](int column, int row) -> double {
    return depths[static_cast<std::size_t>(row * width + column)];
  };
  const double u = pixel.u - x;
  const double v = pixel.v - y;
  const double depth = (1 - v) * ((1 - u) * at(x, y) + u * at(x + 1, y)) +
                       v * ((1 - u) * at(x, y + 1) + u * at(x + 1, y + 1));
  for (const double corner : {at(x, y), at(x + 1, y), at(x, y + 1), at(x + 1, y + 1)}) {
    if (std::abs(corner - depth) > 0.01 * depth) return std::nullopt;
  }
  const Intrinsics k = intrinsics(recording.camera);
  return recording.truth.poses()[frame].world_from_camera *
         Eigen::Vector3d((pixel.u - k.cx) / k.fx * depth, (pixel.v - k.cy) / k.fy * depth, depth);
}

TEST(MapAtPoses, KeyframesAreWhereThePosesSay) {
  const MapAtPoses& mapped = sweep_map();
  EXPECT_EQ(mapped.frames, 60U);
  EXPECT_EQ(mapped.without_pose, 0U);
  EXPECT_EQ(mapped.without_depth, 0U);
  EXPECT_EQ(mapped.trajectory.size(), 60U);
  ASSERT_GE(mapped.map.frame_count(), 3U);
  EXPECT_LT(mapped.map.frame_count(), 30U) << "a choice of frames";
  for (std::uint32_t k = 0; k < mapped.map.frame_count(); ++k) {
    const std::size_t i = mapped.map.frames().ids[k].value;
    EXPECT_EQ(mapped.map.frames().image_names[k], std::to_string(i) + ".png");
    EXPECT_LT(mapped.map.world_from_camera(FrameIndex{k})
                  .difference_to(sweep().truth.poses()[i].world_from_camera)
                  .norm(),
              1e-12);
  }
}

TEST(MapAtPoses, LandmarksAreOffAsTheirCovariancesSay) {
  const LandmarkMap& map = sweep_map().map;
  ASSERT_TRUE(map.landmarks().descriptors);
  std::vector<LandmarkEstimate> estimates;
  for (std::uint32_t i = 0; i < map.landmark_count(); ++i) {
    if (map.observation_count(LandmarkIndex{i}) < 2) continue;
    const std::size_t first = map.observations().offsets[i];
    const std::size_t frame = map.frames().ids[map.observations().frames[first].value].value;
    LandmarkEstimate estimate;
    estimate.estimate = map.landmarks().positions[i];
    estimate.covariance = map.covariance(LandmarkIndex{i});
    estimate.truth = true_point(sweep(), frame, map.observations().pixels[first]);
    estimates.push_back(estimate);
  }
  ASSERT_GT(estimates.size(), 300U);
  const auto statistics = calibrate_covariances(estimates).all;
  ASSERT_TRUE(statistics);
  RecordProperty("nees_mean", std::to_string(statistics->mean));
  RecordProperty("nees_median", std::to_string(statistics->median));
  RecordProperty("inside_95", std::to_string(statistics->inside_95));
  EXPECT_GT(statistics->count, 300U);
  EXPECT_GT(statistics->inside_95, 0.99);
  EXPECT_GT(statistics->median, 0.24) << "nor merely large";
  EXPECT_LT(statistics->median, 0.95);
}

double share_near(const LandmarkMap& of, const LandmarkMap& in, const Eigen::Vector3d& shift,
                  double radius_m) {
  std::size_t near = 0;
  std::size_t all = 0;
  for (std::uint32_t i = 0; i < of.landmark_count(); ++i) {
    if (of.observation_count(LandmarkIndex{i}) < 3) continue;
    ++all;
    const Eigen::Vector3d at = of.landmarks().positions[i] + shift;
    for (std::uint32_t j = 0; j < in.landmark_count(); ++j) {
      if ((in.landmarks().positions[j] - at).norm() > radius_m) continue;
      ++near;
      break;
    }
  }
  return static_cast<double>(near) / static_cast<double>(all);
}

TEST(MapAtPoses, TwoSessionsCoincideAtTheTrueRelativePose) {
  std::vector<TimedPose> moved;
  for (const TimedPose& pose : sweep().truth.poses()) {
    const Rigid3 aside = Rigid3::from_roll_pitch_yaw({0.04, -0.02, 0.03}, 0.02, 0.01, 0.03);
    moved.push_back({pose.timestamp_s, pose.world_from_camera * aside});
  }
  const Recording other = record(Trajectory(moved), kCamera, 2);
  const MapAtPoses mapped = map_of(other, other.truth);
  const double at_truth = share_near(mapped.map, sweep_map().map, Eigen::Vector3d::Zero(), 0.01);
  const double aside = share_near(mapped.map, sweep_map().map, {0.03, 0.03, 0.03}, 0.01);
  RecordProperty("at_truth", std::to_string(at_truth));
  RecordProperty("aside", std::to_string(aside));
  EXPECT_GT(at_truth, 0.5);
  EXPECT_LT(aside, 0.5 * at_truth);
}

TEST(MapAtPoses, OneAndTwoThreadsMakeTheSameMap) {
  const LandmarkMap map = map_of(sweep(), sweep().truth, {}, {.executor = Executor(2)}).map;
  const LandmarkMap same = map_of(sweep(), sweep().truth).map;
  EXPECT_EQ(map.landmarks().positions, same.landmarks().positions);
  EXPECT_EQ(map.landmarks().covariances, same.landmarks().covariances);
  EXPECT_EQ(map.landmarks().descriptors->bytes, same.landmarks().descriptors->bytes);
  EXPECT_EQ(map.observations().pixels, same.observations().pixels);
}

TEST(MapAtPoses, FramesWithoutAPoseNearInTimeAreLeftOut) {
  std::vector<TimedPose> some;
  for (std::size_t i = 0; i < sweep().truth.size(); ++i) {
    if (i < 5 || (i >= 20 && i < 30)) continue;
    some.push_back(sweep().truth.poses()[i]);
  }
  const MapAtPoses mapped = map_of(sweep(), Trajectory(some));
  EXPECT_EQ(mapped.without_pose, 15U);
  EXPECT_EQ(mapped.trajectory.size(), 45U);
  for (const FrameId& id : mapped.map.frames().ids) {
    EXPECT_TRUE(id.value >= 5 && (id.value < 20 || id.value >= 30)) << id.value;
  }
}

// At 15 Hz half of the frames lie between two poses, 33 ms from either.
TEST(MapAtPoses, PosesAreInterpolated) {
  MapAtPosesOptions patient;
  patient.max_time_difference_s = 0.04;
  const MapAtPoses mapped = map_of(sweep(), every_nth(sweep().truth, 2, 0.0), patient);
  EXPECT_EQ(mapped.without_pose, 1U) << "the last one, after all poses";
  for (const TimedPose& pose : mapped.trajectory.poses()) {
    const Rigid3 truth = interpolated(sweep().truth, pose.timestamp_s).value();
    EXPECT_LT(pose.world_from_camera.difference_to(truth).norm(), 0.004);
  }
  EXPECT_EQ(map_of(sweep(), every_nth(sweep().truth, 2, 0.0)).without_pose, 30U);
}

// As another SLAM writes its keyframes: too few to go between, their times rounded.
TEST(MapAtPoses, APoseOfTheFramesOwnTimeNeedsNoOther) {
  const MapAtPoses mapped = map_of(sweep(), every_nth(sweep().truth, 6, 4e-4));
  EXPECT_EQ(mapped.trajectory.size(), 10U);
  EXPECT_EQ(mapped.without_pose, 50U);
  EXPECT_GT(mapped.map.landmark_count(), 100U);
}

TEST(MapAtPoses, UnreadableKeyframesAreLeftOutAndLogged) {
  const auto read = [](std::size_t i) {
    FrameImages frame = sweep()(i);
    if (i == 0) frame = {frame.timestamp_s, frame.name, {}, "damaged: 0.png", {}};
    return frame;
  };
  std::vector<std::string> log;
  const MapAtPoses mapped =
      map_at_poses(times_of(sweep()), read, sweep().truth, kCamera, {},
                   {.log = [&](std::string_view line) { log.emplace_back(line); }});
  EXPECT_EQ(mapped.unreadable, 1U);
  EXPECT_EQ(mapped.map.frame_count(), sweep_map().map.frame_count() - 1);
  EXPECT_THAT(log, ::testing::ElementsAre(HasSubstr("damaged: 0.png")));
}

std::string refusal(const Trajectory& poses, ErrorKind kind,
                    const MapAtPosesOptions& options = MapAtPosesOptions(),
                    const Execution& execution = {}) {
  const auto white = [](std::size_t i) {
    return FrameImages{static_cast<double>(i),
                       "white.png",
                       GrayImage(320, 240, std::uint8_t{240}),
                       {},
                       DepthImage(320, 240, 1.5F)};
  };
  try {
    map_at_poses(std::vector<double>{0.0, 1.0, 2.0}, white, poses, kCamera, options, execution);
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), kind);
    return error.what();
  }
  return "nothing was thrown";
}

TEST(MapAtPoses, WhatCannotBeMappedIsSaid) {
  const Trajectory good({{0.0, Rigid3()}, {1.0, Rigid3()}});
  const Trajectory late({{100.0, Rigid3()}, {101.5, Rigid3()}});
  EXPECT_THAT(refusal(late, ErrorKind::kInput),
              ::testing::AllOf(HasSubstr("poses from 100.000000 to 101.500000 s"),
                               HasSubstr("frames from 0.000000 to 2.000000 s")));
  EXPECT_THAT(refusal(Trajectory(), ErrorKind::kInput), HasSubstr("poses: there is none"));
  EXPECT_THAT(refusal(good, ErrorKind::kInput), HasSubstr("no landmark in 2 keyframes"));
  MapAtPosesOptions options;
  options.map.covariance = LandmarkCovariance::kMarginal;
  EXPECT_THAT(refusal(good, ErrorKind::kMisuse, options), HasSubstr("map.covariance"));
  options = {};
  options.max_time_difference_s = 0.0;
  EXPECT_THAT(refusal(good, ErrorKind::kMisuse, options), HasSubstr("max_time_difference_s"));
  std::stop_source stopped;
  stopped.request_stop();
  EXPECT_THAT(refusal(good, ErrorKind::kCancelled, {}, {.stop = stopped.get_token()}),
              HasSubstr("cancelled"));
}

}  // namespace
}  // namespace cairn::testing
