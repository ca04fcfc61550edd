// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/vision/close_loops.hpp"

#include <algorithm>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/core/random.hpp"
#include "cairn/map/operations.hpp"
#include "cairn/map/synthetic.hpp"

#include "support/maps.hpp"
#include "support/refusal.hpp"

namespace cairn {
namespace {

using testing::EqualsMap;
using ::testing::HasSubstr;

// Frames first to last of a map, with the landmarks that two of them observed, each found a little apart
// from where it is.
LandmarkMap piece_of(const LandmarkMap& map, std::uint32_t first, std::uint32_t last,
                     std::uint64_t seed) {
  Random random(seed);
  LandmarkMap copy = map;
  MapTables from = std::move(copy).tables();
  MapTables tables;
  tables.info = from.info;
  tables.cameras = from.cameras;
  for (std::uint32_t i = first; i <= last; ++i) {
    tables.frames.ids.push_back(from.frames.ids[i]);
    tables.frames.translations.push_back(from.frames.translations[i]);
    tables.frames.quaternions.push_back(from.frames.quaternions[i]);
    tables.frames.cameras.push_back(CameraIndex{0});
    tables.frames.timestamps_s.push_back(from.frames.timestamps_s[i].value());
  }
  LandmarkTable& landmarks = tables.landmarks;
  ObservationTable& observations = tables.observations;
  observations.offsets.push_back(0);
  for (std::uint32_t l = 0; l < map.landmark_count(); ++l) {
    const auto seen_by = map.observing_frames(LandmarkIndex{l});
    const auto within = [&](FrameIndex frame) {
      return frame.value >= first && frame.value <= last;
    };
    if (std::count_if(seen_by.begin(), seen_by.end(), within) < 2) continue;
    landmarks.ids.push_back(from.landmarks.ids[l]);
    Eigen::Vector3d off;
    for (int k = 0; k < 3; ++k) off[k] = 0.002 * random.normal();
    landmarks.positions.push_back(from.landmarks.positions[l] + off);
    landmarks.covariances.push_back(4e-6 * Eigen::Matrix3d::Identity());
    for (std::uint64_t k = from.observations.offsets[l]; k < from.observations.offsets[l + 1];
         ++k) {
      const FrameIndex frame = from.observations.frames[k];
      if (!within(frame)) continue;
      observations.frames.push_back(FrameIndex{frame.value - first});
      observations.pixels.push_back(from.observations.pixels[k]);
      observations.depths.push_back(from.observations.depths[k].value());
    }
    observations.offsets.push_back(observations.frames.size());
  }
  return LandmarkMap(std::move(tables));
}

// A session of a desk in pieces, whose odometry turns by so much more than the camera at every step.
MappedSequence session_in_pieces(const LandmarkMap& truth, std::size_t pieces, double drift_rad) {
  MappedSequence session;
  const auto length = static_cast<std::uint32_t>((truth.frame_count() - 1) / pieces);
  std::vector<TimedPose> poses;
  Rigid3 first_from_piece;
  for (std::uint32_t p = 0; p < pieces; ++p) {
    const std::uint32_t begin = p * length;
    const LandmarkMap piece = piece_of(truth, begin, begin + length, p);
    const Rigid3 camera_from_world = piece.world_from_camera(FrameIndex{0}).inverse();
    session.maps.push_back(
        transformed(piece, p == 0 ? Similarity3() : Similarity3(camera_from_world)));
    const LandmarkMap& map = session.maps.back();
    for (std::uint32_t i = p == 0 ? 0 : 1; i <= length; ++i) {
      poses.push_back({map.frames().timestamps_s[i].value(),
                       first_from_piece * map.world_from_camera(FrameIndex{i})});
    }
    if (p + 1 == pieces) break;
    const Rigid3 previous_from_next =
        map.world_from_camera(FrameIndex{length}) *
        Rigid3::from_roll_pitch_yaw({0.005, 0.0, 0.0}, 0.0, drift_rad, 0.0);
    Vector6d variances;
    variances << 1e-4, 1e-4, 1e-4, 4e-4, 4e-4, 4e-4;
    session.links.push_back({.target = NodeId{p},
                             .source = NodeId{p + 1},
                             .kind = LinkKind::kOdometry,
                             .target_from_source = Similarity3(previous_from_next),
                             .covariance = Matrix6d(variances.asDiagonal())});
    first_from_piece = first_from_piece * previous_from_next;
  }
  session.trajectory = Trajectory(std::move(poses));
  session.frames = session.tracked = session.trajectory.size();
  return session;
}

LandmarkMap desk() {
  return synthetic_map({.seed = 5, .landmarks = 2500, .frames = 61});
}

double largest_error(const Trajectory& trajectory, const LandmarkMap& truth) {
  double most = 0.0;
  for (std::uint32_t i = 0; i < truth.frame_count(); ++i) {
    const TimedPose* pose = nearest_pose(trajectory, truth.frames().timestamps_s[i].value());
    const Vector6d off =
        truth.world_from_camera(FrameIndex{i}).difference_to(pose->world_from_camera);
    most = std::max(most, off.head<3>().norm());
  }
  return most;
}

TEST(CloseLoops, MendsWhatOdometryDriftedAndMakesOneMap) {
  const LandmarkMap truth = desk();
  const MappedSequence session = session_in_pieces(truth, 4, 0.03);
  const ClosedLoops loops = close_loops(session);
  EXPECT_EQ(loops.links.size(), 6U);
  EXPECT_GT(loops.closed, 0U);
  ASSERT_TRUE(loops.map);
  EXPECT_EQ(loops.map->frame_count(), 61U);  // none twice
  EXPECT_EQ(loops.map->frames().ids.back(), FrameId{60});
  EXPECT_EQ(loops.trajectory.size(), session.trajectory.size());
  EXPECT_GT(largest_error(session.trajectory, truth), 0.03);
  EXPECT_LT(largest_error(loops.trajectory, truth), 0.006);
  EXPECT_GT(loops.largest_shift_m, 0.02);
  EXPECT_EQ(loops.map->column(kFusedColumn), nullptr);
  // Keyframes of the trajectory and of the map are the same.
  for (std::uint32_t i = 0; i < loops.map->frame_count(); ++i) {
    const auto time = loops.map->frames().timestamps_s[i].value();
    const Vector6d off =
        loops.map->world_from_camera(FrameIndex{i})
            .difference_to(nearest_pose(loops.trajectory, time)->world_from_camera);
    EXPECT_LT(off.norm(), 1e-9);
  }
}

TEST(CloseLoops, SameResultWithAnyNumberOfThreadsAndByRecognition) {
  const LandmarkMap truth = desk();
  const MappedSequence session = session_in_pieces(truth, 3, 0.02);
  MergeOptions options;
  options.matching_rounds = 0;
  const ClosedLoops one = close_loops(session, options);
  const ClosedLoops two = close_loops(session, options, 1, {.executor = Executor(2)});
  ASSERT_TRUE(one.map && two.map);
  EXPECT_THAT(*two.map, EqualsMap(*one.map));
}

TEST(CloseLoops, StatesHowUncertainKeyframesAreAsOdometryDoes) {
  MergeOptions options;
  options.matching_rounds = 0;
  const ClosedLoops loops = close_loops(session_in_pieces(desk(), 3, 0.0), options);
  ASSERT_TRUE(loops.map);
  const auto& covariances = loops.map->frames().pose_covariances;
  ASSERT_EQ(covariances.size(), loops.map->frame_count());
  EXPECT_TRUE(covariances[0]->isZero(0.0));
  for (std::size_t i = 1; i < covariances.size(); ++i) {
    // At least what common errors of the sensor amount to.
    EXPECT_GT(covariances[i]->diagonal().head<3>().minCoeff(), 0.004 * 0.004);
    EXPECT_GT(covariances[i]->diagonal().tail<3>().minCoeff(), 0.004 * 0.004);
  }
}

TEST(CloseLoops, NeighboursAloneAreNoLoop) {
  const MappedSequence session = session_in_pieces(desk(), 2, 0.02);
  const ClosedLoops loops = close_loops(session);
  EXPECT_EQ(loops.links.size(), 1U);
  EXPECT_EQ(loops.closed, 0U);
  EXPECT_FALSE(loops.map);
  EXPECT_TRUE(loops.trajectory.empty());
}

TEST(CloseLoops, LeavesOutLandmarksThatTooFewKeyframesObserved) {
  const MappedSequence session = session_in_pieces(desk(), 3, 0.0);
  MergeOptions options;
  options.matching_rounds = 0;
  const ClosedLoops loops = close_loops(session, options, 6);
  ASSERT_TRUE(loops.map);
  for (std::uint32_t l = 0; l < loops.map->landmark_count(); ++l) {
    EXPECT_GE(loops.map->observation_count(LandmarkIndex{l}), 6U);
  }
}

TEST(CloseLoops, RefusesASessionWithoutItsLinks) {
  MappedSequence session = session_in_pieces(desk(), 2, 0.0);
  session.links.clear();
  EXPECT_THAT(testing::refusal(ErrorKind::kMisuse, [&] { close_loops(session); }),
              HasSubstr("2 maps, 0 links"));
}

}  // namespace
}  // namespace cairn
