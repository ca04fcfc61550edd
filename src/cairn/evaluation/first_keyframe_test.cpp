// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/core/error.hpp"
#include "cairn/evaluation/covariance_calibration.hpp"
#include "cairn/geometry/covariance.hpp"
#include "cairn/map/operations.hpp"
#include "cairn/map/synthetic.hpp"

#include "support/maps.hpp"
#include "support/refusal.hpp"

namespace cairn {
namespace {

using ::testing::HasSubstr;

const Rigid3 kMotion = Rigid3::from_roll_pitch_yaw({5, -6, 7}, 1.0, 0.5, -2.0);

std::string refusal(auto&& call, ErrorKind kind = ErrorKind::kInput) {
  return testing::refusal(kind, call);
}

CovarianceCalibration calibration(const LandmarkMap& map, const LandmarkMap& truth) {
  const auto positions = true_positions_in_first_keyframe(map, truth, keyframe_poses(map, truth));
  return calibrate_covariances(estimates_in_first_keyframe(map, positions));
}

TEST(FirstKeyframe, IsTheObservingFrameOfTheLowestId) {
  // Observed in frames 7 and 3, in that order; unobserved; in frame 18446744073709551615.
  const LandmarkMap map = testing::full_map();
  EXPECT_EQ(first_keyframe(map, LandmarkIndex{0}), FrameIndex{2});
  EXPECT_EQ(first_keyframe(map, LandmarkIndex{1}), FrameIndex{1});
  EXPECT_FALSE(first_keyframe(map, LandmarkIndex{2}));
  EXPECT_FALSE(first_keyframe(LandmarkMap([] {
                                MapTables cloud;
                                cloud.landmarks = testing::plain_tables().landmarks;
                                return cloud;
                              }()),
                              LandmarkIndex{0}));
}

TEST(EstimatesInFirstKeyframe, AreTheMapsLandmarksSeenFromThere) {
  MapTables tables = testing::plain_tables();
  // A camera at (0, 0, -1) that is turned by 90 degrees about its own optical axis.
  const Rigid3 world_from_camera(
      Eigen::Quaterniond(Eigen::AngleAxisd(std::numbers::pi / 2, Eigen::Vector3d::UnitZ())),
      {0, 0, -1});
  const Eigen::Quaterniond q = world_from_camera.quaternion();
  tables.frames.quaternions[0] = {q.w(), q.x(), q.y(), q.z()};
  tables.frames.translations[0] = {0, 0, -1};
  tables.landmarks.covariances[0] = Eigen::Vector3d(1e-4, 4e-4, 9e-4).asDiagonal();
  const LandmarkMap map(std::move(tables));
  const std::vector<std::optional<Eigen::Vector3d>> truth = {Eigen::Vector3d(1, 2, 3), std::nullopt,
                                                             Eigen::Vector3d(4, 5, 6)};
  const auto estimates = estimates_in_first_keyframe(map, truth);
  ASSERT_EQ(estimates.size(), 3U);
  // (0.5, 0, 2) in the world; x of the world is -y of the camera.
  EXPECT_LT((estimates[0].estimate - Eigen::Vector3d(0, -0.5, 3)).norm(), 1e-12);
  EXPECT_LT((estimates[0].covariance->diagonal() - Eigen::Vector3d(4e-4, 1e-4, 9e-4)).norm(),
            1e-12);
  EXPECT_NEAR(*estimates[0].depth, 3.0, 1e-12);
  EXPECT_EQ(estimates[0].observations, 2U);
  EXPECT_EQ(estimates[0].truth, Eigen::Vector3d(1, 2, 3));
  EXPECT_FALSE(estimates[1].truth);
  EXPECT_FALSE(estimates[2].truth) << "never observed";
  EXPECT_FALSE(estimates[2].depth);
}

TEST(EstimatesInFirstKeyframe, NameWhatTheMapLacks) {
  MapTables tables = testing::plain_tables();
  tables.landmarks.covariances.clear();
  const std::vector<std::optional<Eigen::Vector3d>> truth(3);
  EXPECT_THAT(refusal([&] { estimates_in_first_keyframe(LandmarkMap(tables), truth); }),
              HasSubstr("the map has no landmark covariances"));
  tables.observations = {};
  EXPECT_THAT(refusal([&] { estimates_in_first_keyframe(LandmarkMap(tables), truth); }),
              HasSubstr("the map has no observations"));
  EXPECT_THAT(
      refusal([&] { estimates_in_first_keyframe(testing::plain_map(), {}); }, ErrorKind::kMisuse),
      HasSubstr("truth_in_keyframe: 0 entries; expected 3, one a landmark"));
}

TEST(EstimatesInFirstKeyframe, NameWhatAMapOfOneLandmarkLacks) {
  MapTables tables;
  tables.frames.ids = {FrameId{1}};
  tables.frames.translations = {{0, 0, 0}};
  tables.frames.quaternions = {{1, 0, 0, 0}};
  tables.landmarks.ids = {LandmarkId{1}};
  tables.landmarks.positions = {{0, 0, 1}};
  tables.observations.offsets = {0, 1};
  tables.observations.frames = {FrameIndex{0}};
  tables.observations.pixels = {{320, 240}};
  const LandmarkMap map(std::move(tables));
  EXPECT_THAT(refusal([&] {
                estimates_in_first_keyframe(map, std::vector<std::optional<Eigen::Vector3d>>(1));
              }),
              HasSubstr("the map has no landmark covariances"));
  EXPECT_THAT(refusal([&] { keyframe_poses(map, Trajectory()); }), HasSubstr("no timestamps"));
  EXPECT_EQ(refusal([] { keyframe_poses(LandmarkMap(), Trajectory()); }), "");
}

TEST(EstimatesInFirstKeyframe, OfAnEmptyMapAreNone) {
  EXPECT_TRUE(estimates_in_first_keyframe(LandmarkMap(), {}).empty());
}

// The synthetic map says of its covariances that they are its estimates' own.
TEST(Calibration, OfASyntheticMapIsRight) {
  const SyntheticOptions options = {.seed = 4, .landmarks = 4000, .frames = 40};
  SyntheticOptions exact = options;
  exact.pixel_noise_px = exact.depth_noise_m = 0.0;
  const LandmarkMap map = synthetic_map(options);
  const LandmarkMap truth = synthetic_map(exact);
  const CovarianceCalibration result = calibration(map, truth);
  EXPECT_GT(result.all->count, 3000U);
  EXPECT_NEAR(result.all->mean, kExpectedNees, 0.3);
  EXPECT_NEAR(result.all->inside_95, 0.95, 0.02);

  // Neither does it matter in which world frame either map is.
  const CovarianceCalibration moved = calibration(transformed(map, kMotion), truth);
  EXPECT_EQ(moved.all->count, result.all->count);
  EXPECT_NEAR(moved.all->mean, result.all->mean, 1e-6);
  for (std::size_t i = 0; i < result.by_depth.size(); ++i) {
    EXPECT_EQ(moved.by_depth[i].statistics.has_value(), result.by_depth[i].statistics.has_value());
  }
}

TEST(TruePositions, AreFoundByIdsOfLandmarksAndFrames) {
  const LandmarkMap map = testing::plain_map();
  MapTables tables = testing::plain_tables();
  std::reverse(tables.landmarks.ids.begin(), tables.landmarks.ids.end());
  std::reverse(tables.landmarks.positions.begin(), tables.landmarks.positions.end());
  tables.landmarks.ids[1] = LandmarkId{77};  // landmark 2 is unknown to it
  tables.observations = {};
  const LandmarkMap truth = transformed(LandmarkMap(std::move(tables)), kMotion);
  const auto positions = true_positions_in_first_keyframe(map, truth, keyframe_poses(map, truth));
  ASSERT_EQ(positions.size(), 3U);
  EXPECT_LT((*positions[0] - Eigen::Vector3d(0.5, 0, 2)).norm(), 1e-12);
  EXPECT_FALSE(positions[1]);
  EXPECT_FALSE(positions[2]) << "never observed";

  KeyframePoses unknown = keyframe_poses(map, truth);
  unknown[0].reset();
  EXPECT_FALSE(true_positions_in_first_keyframe(map, truth, unknown)[0]);
  EXPECT_THAT(
      refusal([&] { true_positions_in_first_keyframe(map, truth, {}); }, ErrorKind::kMisuse),
      HasSubstr("truth_from_keyframe: 0 entries; expected 2, one a frame"));
  EXPECT_THAT(refusal([&] {
                true_positions_in_first_keyframe(map, testing::full_map(), KeyframePoses(2));
              }),
              HasSubstr("unit of length"));
}

TEST(KeyframePoses, OfATrajectoryAreTheNearestInTime) {
  MapTables tables = testing::plain_tables();
  tables.frames.timestamps_s = {10.004, 20.0};
  const LandmarkMap map(tables);
  const auto at = [](double time) {
    return TimedPose{time, Rigid3(Eigen::Quaterniond::Identity(), {time, 0, 0})};
  };
  const auto poses = keyframe_poses(map, Trajectory({at(9.99), at(10.0), at(10.01), at(30.0)}));
  ASSERT_EQ(poses.size(), 2U);
  EXPECT_EQ(poses[0]->translation().x(), 10.0);
  EXPECT_FALSE(poses[1]) << "ten seconds off";
  EXPECT_EQ(keyframe_poses(map, Trajectory({at(19.99)}))[1]->translation().x(), 19.99);
  EXPECT_FALSE(keyframe_poses(map, Trajectory())[0]);
  // Nearer than the difference given, not as near as that.
  tables.frames.timestamps_s = {10.0, 20.0};
  const Trajectory later({at(10.5), at(19.75)});
  EXPECT_FALSE(keyframe_poses(LandmarkMap(tables), later, 0.5)[0]);
  EXPECT_TRUE(keyframe_poses(LandmarkMap(tables), later, 0.5)[1]);
  EXPECT_TRUE(keyframe_poses(LandmarkMap(tables), later, 0.75)[0]);
  tables.frames.timestamps_s = {std::nullopt, 20.0};
  EXPECT_FALSE(keyframe_poses(LandmarkMap(tables), later, 100.0)[0]) << "of unknown time";
  // Two cameras may take their frames at one time.
  tables.frames.timestamps_s = {10.0, 10.0};
  const auto both = keyframe_poses(LandmarkMap(tables), Trajectory({at(10.0), at(10.01)}));
  EXPECT_EQ(both[0]->translation().x(), 10.0);
  EXPECT_EQ(both[1]->translation().x(), 10.0);
  EXPECT_THAT(refusal([&] { keyframe_poses(testing::plain_map(), Trajectory({at(1.0)})); }),
              HasSubstr("the map has no timestamps of its frames"));
}

}  // namespace
}  // namespace cairn
