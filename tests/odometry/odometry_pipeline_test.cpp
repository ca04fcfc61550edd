// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <numbers>
#include <set>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/core/error.hpp"
#include "cairn/evaluation/trajectory_evaluation.hpp"

#include "recording.hpp"

namespace cairn::testing {
namespace {

using ::testing::HasSubstr;

const MapSequenceOptions kDefaults;

template <class Read>
MappedSequence map_with(const Recording& recording, const Read& read,
                        const MapSequenceOptions& options = kDefaults) {
  return map_frames(recording.frames.size(), read, recording.camera, options);
}

MappedSequence map_of(const Recording& recording, const MapSequenceOptions& options = kDefaults) {
  return map_with(recording, recording, options);
}

AbsoluteError error_of(const MappedSequence& mapped, const Trajectory& truth,
                       TrajectoryAlignment alignment = TrajectoryAlignment::kSe3) {
  const PosePairs pairs = associate(mapped.trajectory, truth);
  EXPECT_EQ(pairs.size(), mapped.trajectory.size());
  const auto error = absolute_error(mapped.trajectory, truth, pairs, alignment);
  return error ? *error : throw std::runtime_error("the trajectory cannot be compared");
}

MapSequenceOptions starting_from(const Trajectory& truth) {
  MapSequenceOptions options;
  options.odometry.start = [&truth](double time) { return interpolated(truth, time).value(); };
  return options;
}

void expect_sound_covariances(const LandmarkMap& map) {
  ASSERT_TRUE(map.has_covariances());
  for (std::uint32_t i = 0; i < map.landmark_count(); ++i) {
    const auto covariance = map.covariance(LandmarkIndex{i});
    ASSERT_TRUE(covariance && covariance->allFinite()) << i;
    ASSERT_GT(covariance->determinant(), 0.0) << i;
  }
}

TEST(OdometryPipeline, FollowsTheCamera) {
  const MappedSequence mapped = map_of(sweep());
  EXPECT_EQ(mapped.tracked, sweep().frames.size());
  const AbsoluteError error = error_of(mapped, sweep().truth);
  RecordProperty("ate_mm", std::to_string(1e3 * error.translation.rmse));
  EXPECT_LT(error.translation.rmse, 0.005);
  // Not the same alignment: so short a path fixes its own rotation by a degree only.
  EXPECT_LT(error_of(mapped, sweep().truth, TrajectoryAlignment::kOrigin).rotation_rad.rmse, 0.004);
  ASSERT_TRUE(mapped.median_reprojection_error);
  EXPECT_LT(*mapped.median_reprojection_error, 0.6);
  EXPECT_GT(mapped.trajectory.length(), 0.3) << "a path worth the name";
}

TEST(OdometryPipeline, LandmarksLieOnTheSurfacesOfTheScene) {
  const MappedSequence mapped = map_of(sweep(), starting_from(sweep().truth));
  const LandmarkMap& map = mapped.maps.at(0);
  expect_sound_covariances(map);
  std::vector<double> distances;
  for (std::uint32_t i = 0; i < map.landmark_count(); ++i) {
    if (map.observation_count(LandmarkIndex{i}) < 3) continue;
    distances.push_back(desk().scene.distance(map.landmarks().positions[i]));
  }
  ASSERT_GT(distances.size(), 300U);
  std::sort(distances.begin(), distances.end());
  EXPECT_LT(distances[distances.size() / 2], 0.006);
  EXPECT_LT(distances[distances.size() * 9 / 10], 0.03);
}

// Landmarks whose first keyframe's exact depth beside the pixel is known, and the share in their 95 % ellipsoid along
// the line of sight.
double share_within_95(const LandmarkMap& map, const Recording& recording) {
  std::size_t all = 0;
  std::size_t within = 0;
  for (std::uint32_t i = 0; i < map.landmark_count(); ++i) {
    const LandmarkIndex landmark{i};
    if (map.observation_count(landmark) < 2) continue;
    const FrameIndex first = map.observing_frames(landmark)[0];
    const Pixel pixel = map.observed_pixels(landmark)[0];
    const auto u = static_cast<std::size_t>(std::lround(pixel.u));
    const auto v = static_cast<std::size_t>(std::lround(pixel.v));
    const auto& depths = recording.exact_depths_m[map.frames().ids[first.value].value];
    const auto depth_at = [&](std::size_t x, std::size_t y) {
      return static_cast<double>(depths[y * recording.camera.width + x]);
    };
    const double depth = depth_at(u, v);
    constexpr std::size_t kBeside =
        6;  // another surface is near: which one the landmark is on is open
    if (std::abs(depth_at(u - kBeside, v) + depth_at(u + kBeside, v) - 2.0 * depth) > 0.05 ||
        std::abs(depth_at(u, v - kBeside) + depth_at(u, v + kBeside) - 2.0 * depth) > 0.05) {
      continue;
    }
    const Rigid3 world_from_camera = map.world_from_camera(first);
    const Eigen::Vector3d axis = world_from_camera.rotation().col(2);
    const double off =
        axis.dot(map.landmarks().positions[i] - world_from_camera.translation()) - depth;
    constexpr double k95 = 3.841;
    ++all;
    within += off * off <= k95 * axis.dot(*map.covariance(landmark) * axis) ? 1 : 0;
  }
  EXPECT_GT(all, 200U);
  return static_cast<double>(within) / static_cast<double>(all);
}

TEST(OdometryPipeline, AStereoCameraFollowsAsAnRgbdCameraDoes) {
  constexpr double kBaseline = 0.11;
  const Recording recording = record(sweep().truth, kCamera, 1, 0.0, 1, kBaseline);
  MapSequenceOptions options = starting_from(recording.truth);
  options.odometry.features.baseline_m = kBaseline;
  const MappedSequence mapped = map_of(recording, options);
  EXPECT_EQ(mapped.tracked, recording.frames.size());
  EXPECT_EQ(mapped.frames_without_depth, 0U);
  const double rgbd = error_of(map_of(sweep()), sweep().truth).translation.rmse;
  const double stereo = error_of(mapped, recording.truth).translation.rmse;
  const double share = share_within_95(mapped.maps.at(0), recording);
  RecordProperty("rgbd_ate_mm", std::to_string(1e3 * rgbd));
  RecordProperty("stereo_ate_mm", std::to_string(1e3 * stereo));
  RecordProperty("within_95", std::to_string(share));
  EXPECT_LT(stereo, 1.5 * rgbd);
  // The aim is 0.9, which is not reached on the desk: 0.874 when this was written.
  EXPECT_GT(share, 0.85);
  EXPECT_LT(share, 0.98);
  expect_sound_covariances(mapped.maps.at(0));
}

TEST(OdometryPipeline, FollowsACameraWithDistortion) {
  const Camera camera{
      {1},
      "FULL_OPENCV",
      320,
      240,
      {258.6, 258.2, 159.3, 127.6, 0.2624, -0.9531, -0.0054, 0.0026, 1.1633, 0.0, 0.0, 0.0}};
  const Recording recording = record(make_path(desk(), {.frames = 30}), camera);
  const MappedSequence mapped = map_of(recording);
  EXPECT_EQ(mapped.tracked, 30U);
  EXPECT_LT(error_of(mapped, recording.truth).translation.rmse, 0.006);
}

TEST(OdometryPipeline, OneAndTwoThreadsMakeTheSameMap) {
  std::vector<MappedSequence> runs;
  for (const unsigned threads : {1U, 2U}) {
    runs.push_back(map_frames(sweep().frames.size(), sweep(), sweep().camera, kDefaults,
                              {.executor = Executor(threads)}));
  }
  ASSERT_EQ(runs[0].trajectory.size(), runs[1].trajectory.size());
  for (std::size_t i = 0; i < runs[0].trajectory.size(); ++i) {
    ASSERT_EQ(runs[0].trajectory.poses()[i].world_from_camera.matrix(),
              runs[1].trajectory.poses()[i].world_from_camera.matrix());
  }
  const LandmarkMap& a = runs[0].maps.at(0);
  const LandmarkMap& b = runs[1].maps.at(0);
  EXPECT_EQ(a.landmarks().positions, b.landmarks().positions);
  EXPECT_EQ(a.landmarks().covariances, b.landmarks().covariances);
  EXPECT_EQ(a.landmarks().descriptors->bytes, b.landmarks().descriptors->bytes);
  EXPECT_EQ(a.observations().pixels, b.observations().pixels);
  EXPECT_EQ(a.frames().translations, b.frames().translations);
}

TEST(OdometryPipeline, OneFrameIsAMap) {
  const MappedSequence mapped = map_frames(1, sweep(), kCamera, kDefaults);
  EXPECT_EQ(mapped.tracked, 1U);
  EXPECT_EQ(mapped.keyframes, 1U);
  EXPECT_EQ(mapped.trajectory.size(), 1U);
  EXPECT_FALSE(mapped.median_reprojection_error);
  ASSERT_EQ(mapped.maps.size(), 1U);
  EXPECT_GT(mapped.maps[0].landmark_count(), 100U);
  expect_sound_covariances(mapped.maps[0]);
}

TEST(OdometryPipeline, AStillCameraStaysAndMakesFewKeyframes) {
  std::vector<TimedPose> poses;
  for (int i = 0; i < 60; ++i) {
    poses.push_back({i / 30.0, sweep().truth.poses()[10].world_from_camera});
  }
  const Recording recording = record(Trajectory(poses));
  for (const auto covariance : {LandmarkCovariance::kRecursive, LandmarkCovariance::kMarginal}) {
    MapSequenceOptions options;
    options.map.covariance = covariance;
    const MappedSequence mapped = map_of(recording, options);
    EXPECT_EQ(mapped.tracked, 60U);
    EXPECT_LE(mapped.keyframes, 3U);
    expect_sound_covariances(mapped.maps.at(0));
    EXPECT_LT(error_of(mapped, recording.truth, TrajectoryAlignment::kOrigin).translation.highest,
              0.004);
  }
}

TEST(OdometryPipeline, FollowsAPureRotation) {
  const Rigid3 start = sweep().truth.poses()[0].world_from_camera;
  std::vector<TimedPose> poses;
  for (int i = 0; i < 40; ++i) {
    const double angle = 1.5 * i * std::numbers::pi / 180.0;
    poses.push_back({i / 30.0, start * Rigid3::from_roll_pitch_yaw({0, 0, 0}, 0, angle, 0)});
  }
  const Recording recording = record(Trajectory(poses));
  const MappedSequence mapped = map_of(recording);
  EXPECT_EQ(mapped.tracked, 40U);
  const AbsoluteError error = error_of(mapped, recording.truth, TrajectoryAlignment::kOrigin);
  EXPECT_LT(error.translation.highest, 0.02);
  EXPECT_LT(error.rotation_rad.highest, 0.01);
  expect_sound_covariances(mapped.maps.at(0));
}

// Swings to and fro in place at up to 100 degrees a second. A frame has several poses of the path, so
// that the speed changes while it is read out.
struct FastTurn {
  static constexpr double kReadout = 0.03;
  Recording recording = recorded();

  static Recording recorded() {
    constexpr int kPosesAFrame = 4;
    const Rigid3 start = sweep().truth.poses()[0].world_from_camera;
    std::vector<TimedPose> poses;
    for (int i = 0; i < 45 * kPosesAFrame; ++i) {
      const double time = i / (30.0 * kPosesAFrame);
      const double angle = 0.35 * (1.0 - std::cos(2.0 * std::numbers::pi * 0.8 * time));
      poses.push_back({time, start * Rigid3::from_roll_pitch_yaw({0, 0, 0}, 0, angle, 0)});
    }
    return record(Trajectory(poses), kCamera, 1, kReadout, kPosesAFrame);
  }
  // The largest error of a rotation; the frame `dark` is black.
  double bend(double readout_s, std::size_t dark = 100) const {
    const auto read = [&](std::size_t i) {
      FrameImages frame = recording(i);
      if (i == dark) frame.gray = GrayImage(320, 240);
      return frame;
    };
    MapSequenceOptions options;
    options.odometry.readout_s = readout_s;
    const MappedSequence mapped = map_with(recording, read, options);
    if (readout_s > 0.0) {
      EXPECT_EQ(mapped.tracked, dark < recording.frames.size() ? 44U : 45U);
    }
    return error_of(mapped, recording.truth, TrajectoryAlignment::kOrigin).rotation_rad.highest;
  }
};

TEST(OdometryPipeline, CorrectsARollingShutter) {
  const FastTurn turn;
  const double uncorrected = turn.bend(0.0);
  const double corrected = turn.bend(FastTurn::kReadout);
  RecordProperty("uncorrected_mrad", std::to_string(1e3 * uncorrected));
  RecordProperty("corrected_mrad", std::to_string(1e3 * corrected));
  EXPECT_LT(corrected, 0.6 * uncorrected);
}

// The ninth frame is where the camera turns fastest.
TEST(OdometryPipeline, CorrectsARollingShutterAfterALostFrame) {
  const FastTurn turn;
  const double whole = turn.bend(FastTurn::kReadout);
  const double bridged = turn.bend(FastTurn::kReadout, 9);
  RecordProperty("whole_mrad", std::to_string(1e3 * whole));
  RecordProperty("bridged_mrad", std::to_string(1e3 * bridged));
  EXPECT_LT(bridged, 1.2 * whole);
}

// Its speed during the readout is uncertain, and all that is mapped from it would be off by as much.
TEST(OdometryPipeline, MapsNothingFromARollingShutterJustAfterALostFrame) {
  const FastTurn turn;
  constexpr std::size_t kDark = 9;
  const auto read = [&](std::size_t i) {
    FrameImages frame = turn.recording(i);
    if (i == kDark) frame.gray = GrayImage(320, 240);
    return frame;
  };
  const auto keyframe_times = [&](double readout_s) {
    MapSequenceOptions options;
    options.odometry.readout_s = readout_s;
    options.mini_maps = MiniMapLength{{}, 2, {}};
    std::set<double> times;
    for (const LandmarkMap& map : map_with(turn.recording, read, options).maps) {
      for (std::size_t i = 0; i < map.frame_count(); ++i) {
        times.insert(map.frames().timestamps_s[i].value());
      }
    }
    return times;
  };
  const double after = turn.recording.frames[kDark + 1].timestamp_s;
  const double next = turn.recording.frames[kDark + 2].timestamp_s;
  EXPECT_EQ(keyframe_times(FastTurn::kReadout).count(after), 0U);
  EXPECT_EQ(keyframe_times(FastTurn::kReadout).count(next), 1U);
  EXPECT_EQ(keyframe_times(0.0).count(after), 1U) << "a mini-map of two frames begins there";
}

TEST(OdometryPipeline, AWhiteWallIsNothingToBeginWith) {
  const auto read = [](std::size_t i) {
    return FrameImages{static_cast<double>(i),
                       "white.png",
                       GrayImage(320, 240, std::uint8_t{240}),
                       {},
                       DepthImage(320, 240, 1.5F)};
  };
  const MappedSequence mapped = map_frames(10, read, kCamera, kDefaults);
  EXPECT_EQ(mapped.waiting, 10U);
  EXPECT_EQ(mapped.tracked, 0U);
  EXPECT_TRUE(mapped.maps.empty());
  EXPECT_TRUE(mapped.trajectory.empty());
  EXPECT_TRUE(mapped.lost.empty());
}

TEST(OdometryPipeline, FindsItselfAgainAfterADarkStretch) {
  const auto read = [](std::size_t i) {
    FrameImages frame = sweep()(i);
    if (i >= 25 && i < 32) frame.gray = GrayImage(320, 240);
    return frame;
  };
  const MappedSequence mapped = map_with(sweep(), read);
  ASSERT_EQ(mapped.lost.size(), 1U);
  EXPECT_EQ(mapped.lost[0].frames, 7U);
  EXPECT_EQ(mapped.lost[0].first_timestamp_s, sweep().truth.poses()[25].timestamp_s);
  EXPECT_EQ(mapped.lost[0].last_timestamp_s, sweep().truth.poses()[31].timestamp_s);
  EXPECT_EQ(mapped.tracked, sweep().frames.size() - 7);
  EXPECT_LT(error_of(mapped, sweep().truth).translation.rmse, 0.008);
}

TEST(OdometryPipeline, WithoutAnyDepthItWaits) {
  const auto without = [](std::size_t i) {
    FrameImages frame = sweep()(i);
    frame.depth_m = {};
    return frame;
  };
  MappedSequence mapped = map_frames(10, without, kCamera, kDefaults);
  EXPECT_EQ(mapped.waiting, 10U);
  EXPECT_EQ(mapped.frames_without_depth, 10U);
  EXPECT_TRUE(mapped.maps.empty());
  const auto no_reading = [](std::size_t i) {
    FrameImages frame = sweep()(i);
    frame.depth_m = DepthImage(320, 240);
    return frame;
  };
  mapped = map_frames(10, no_reading, kCamera, kDefaults);
  EXPECT_EQ(mapped.waiting, 10U);
  EXPECT_EQ(mapped.frames_without_depth, 0U);
  EXPECT_TRUE(mapped.maps.empty());
}

TEST(OdometryPipeline, FramesWithoutDepthAreTrackedAllTheSame) {
  const auto read = [](std::size_t i) {
    FrameImages frame = sweep()(i);
    if (i >= 20 && i < 30) frame.depth_m = {};
    return frame;
  };
  const MappedSequence mapped = map_with(sweep(), read);
  EXPECT_EQ(mapped.frames_without_depth, 10U);
  EXPECT_EQ(mapped.tracked, sweep().frames.size());
  EXPECT_LT(error_of(mapped, sweep().truth).translation.rmse, 0.008);
}

TEST(OdometryPipeline, AnImageOfAnotherSizeIsRefused) {
  const auto read = [](std::size_t i) {
    FrameImages frame = sweep()(i);
    if (i == 5) frame.gray = GrayImage(160, 120);
    return frame;
  };
  try {
    map_with(sweep(), read);
    FAIL() << "it was taken";
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::kMisuse);
    EXPECT_THAT(error.what(), HasSubstr("160 x 120"));
    EXPECT_THAT(error.what(), HasSubstr("320 x 240"));
  }
}

TEST(OdometryPipeline, StartedFromTheTruthItStaysNearIt) {
  const MappedSequence mapped = map_of(sweep(), starting_from(sweep().truth));
  const Rigid3& first = mapped.trajectory.poses().front().world_from_camera;
  EXPECT_LT(first.difference_to(sweep().truth.poses()[0].world_from_camera).norm(), 1e-9);
  const AbsoluteError error = error_of(mapped, sweep().truth, TrajectoryAlignment::kNone);
  EXPECT_LT(error.translation.highest, 0.015);
  EXPECT_LT(error.rotation_rad.highest, 0.01);
}

// A link is the true motion between the first cameras of two mini-maps, as well as it says.
TEST(OdometryPipeline, LinksOfMiniMapsAreTheTrueRelativePoses) {
  MapSequenceOptions options;
  options.mini_maps.emplace().frames = 15;
  const MappedSequence mapped = map_of(sweep(), options);
  ASSERT_GE(mapped.maps.size(), 4U);
  ASSERT_EQ(mapped.links.size() + 1, mapped.maps.size());
  const auto truth_at = [](const LandmarkMap& map) {
    return interpolated(sweep().truth, map.frames().timestamps_s.front().value()).value();
  };
  double all = 0.0;
  for (std::size_t i = 0; i < mapped.links.size(); ++i) {
    const Rigid3 truth = truth_at(mapped.maps[i]).inverse() * truth_at(mapped.maps[i + 1]);
    const Vector6d off = truth.difference_to(mapped.links[i].target_from_source->rigid());
    EXPECT_LT(off.head<3>().norm(), 0.008) << i;
    EXPECT_LT(off.tail<3>().norm(), 0.006) << i;
    const Matrix6d& covariance = *mapped.links[i].covariance;
    const double normalised = off.dot(covariance.inverse() * off);
    RecordProperty("normalised_" + std::to_string(i), std::to_string(normalised));
    EXPECT_GT(covariance.determinant(), 0.0);
    EXPECT_LT(normalised, 0.07) << i;
    all += normalised;
    expect_sound_covariances(mapped.maps[i]);
  }
  // Stated for a real camera, whose common errors this one lacks, covariances of links are far too large here. They must
  // not become larger still.
  EXPECT_GT(all / static_cast<double>(mapped.links.size()), 0.008);
  EXPECT_EQ(mapped.trajectory.size(), sweep().frames.size());
  EXPECT_LT(error_of(mapped, sweep().truth).translation.rmse, 0.01);
}

}  // namespace
}  // namespace cairn::testing
