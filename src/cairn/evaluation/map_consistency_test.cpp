// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/evaluation/map_consistency.hpp"

#include <cmath>
#include <limits>
#include <utility>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/core/error.hpp"
#include "cairn/core/random.hpp"
#include "cairn/map/operations.hpp"
#include "cairn/map/synthetic.hpp"

#include "support/maps.hpp"

namespace cairn {
namespace {

using ::testing::IsEmpty;

LandmarkMap exact_map() {
  return synthetic_map({.landmarks = 500, .frames = 20, .pixel_noise_px = 0, .depth_noise_m = 0});
}

// The map with each observation changed by `change(tables, observation)`.
LandmarkMap changed(LandmarkMap map, auto&& change) {
  MapTables tables = std::move(map).tables();
  for (std::size_t i = 0; i < tables.observations.frames.size(); ++i) change(tables, i);
  return LandmarkMap(std::move(tables));
}

TEST(MapConsistency, IsPerfectWithoutNoise) {
  const LandmarkMap map = exact_map();
  const MapConsistency result = map_consistency(map);
  ASSERT_TRUE(result.reprojection);
  EXPECT_EQ(result.reprojection->px.count, map.observation_count());
  EXPECT_LT(result.reprojection->px.highest, 1e-9);
  EXPECT_EQ(result.reprojection->inlier_share, 1.0);
  ASSERT_TRUE(result.depth);
  EXPECT_LT(result.depth->highest, 1e-9);
  EXPECT_EQ(result.observations_behind, 0U);
  EXPECT_THAT(result.missing_for_reprojection, IsEmpty());
  EXPECT_THAT(result.missing_for_depth, IsEmpty());
}

TEST(MapConsistency, FindsTheNoiseOfThePixels) {
  // Distances of normal noise in u and v follow Rayleigh's distribution.
  constexpr double kSigma = 0.8;
  Random random(2);
  const LandmarkMap map = changed(exact_map(), [&](MapTables& tables, std::size_t i) {
    tables.observations.pixels[i].u += kSigma * random.normal();
    tables.observations.pixels[i].v += kSigma * random.normal();
  });
  const auto result = map_consistency(map).reprojection;
  const double tolerance = 3.0 / std::sqrt(static_cast<double>(map.observation_count()));
  EXPECT_NEAR(result->px.rmse / (kSigma * std::sqrt(2.0)), 1.0, tolerance);
  EXPECT_NEAR(result->px.median / (kSigma * std::sqrt(2.0 * std::log(2.0))), 1.0, tolerance);
  EXPECT_NEAR(result->px.percentile_95 / (kSigma * std::sqrt(2.0 * std::log(20.0))), 1.0,
              tolerance);
  EXPECT_NEAR(result->inlier_share, 1.0 - std::exp(-2.0 * 2.0 / (2.0 * kSigma * kSigma)),
              tolerance);
}

TEST(MapConsistency, ShareOfInliersIsOfItsThreshold) {
  const LandmarkMap map = changed(exact_map(), [](MapTables& tables, std::size_t i) {
    tables.observations.pixels[i].u += i % 4 == 0 ? 3.0 : 1.0;
  });
  EXPECT_NEAR(map_consistency(map).reprojection->inlier_share, 0.75, 1e-3);
  EXPECT_EQ(map_consistency(map, 3.5).reprojection->inlier_share, 1.0);
  EXPECT_THROW(map_consistency(map, 0.0), Error);
}

TEST(MapConsistency, KeepsOctavesApart) {
  const LandmarkMap map = changed(exact_map(), [](MapTables& tables, std::size_t i) {
    tables.observations.octaves.resize(tables.observations.frames.size());
    if (i % 3 == 0) return;  // unknown
    const auto octave = static_cast<std::int32_t>(i % 3) - 1;
    tables.observations.octaves[i] = octave;
    tables.observations.pixels[i].v += 0.5 + octave;
  });
  const MapConsistency result = map_consistency(map);
  ASSERT_EQ(result.by_octave.size(), 2U);
  EXPECT_EQ(result.by_octave[0].octave, 0);
  EXPECT_NEAR(result.by_octave[0].statistics.px.mean, 0.5, 1e-9);
  EXPECT_EQ(result.by_octave[1].octave, 1);
  EXPECT_NEAR(result.by_octave[1].statistics.px.mean, 1.5, 1e-9);
  EXPECT_GT(result.reprojection->px.count,
            result.by_octave[0].statistics.px.count + result.by_octave[1].statistics.px.count);
}

TEST(MapConsistency, DepthErrorsAreMeasuredMinusMap) {
  const LandmarkMap map = changed(exact_map(), [](MapTables& tables, std::size_t i) {
    tables.observations.depths[i] = *tables.observations.depths[i] + (i % 2 == 0 ? 0.03 : -0.01);
  });
  const MapConsistency result = map_consistency(map);
  EXPECT_NEAR(*result.depth_bias, 0.01, 1e-4);
  EXPECT_NEAR(result.depth->mean, 0.02, 1e-4);
  EXPECT_NEAR(*result.depth_errors[0], 0.03, 1e-9);
  EXPECT_NEAR(*result.depth_errors[1], -0.01, 1e-9);
}

TEST(MapConsistency, LandmarksBehindTheCameraAreNoInliers) {
  MapTables tables = testing::plain_tables();
  tables.landmarks.positions[0] = {0.5, 0.0, -2.0};
  const LandmarkMap map =
      with_camera(LandmarkMap(std::move(tables)),
                  {CameraId{0}, "PINHOLE", 640, 480, {517.3, 516.5, 318.6, 255.3}});
  const MapConsistency result = map_consistency(map);
  EXPECT_EQ(result.observations_behind, 2U);
  EXPECT_EQ(result.reprojection->px.count, 1U);
  EXPECT_LE(result.reprojection->inlier_share, 1.0 / 3.0);
  EXPECT_FALSE(result.reprojection_px[0]);
}

TEST(MapConsistency, CountsLandmarksBehindTheCameraInTheirOctaves) {
  const Camera camera = {CameraId{0}, "PINHOLE", 640, 480, {500.0, 500.0, 320.0, 240.0}};
  MapTables tables = testing::plain_tables();
  tables.landmarks.positions[0] = {0.5, 0.0, -2.0};  // seen twice
  tables.landmarks.positions[1] = {0.0, 0.0, 2.0};   // seen once
  tables.observations.octaves = {0, 1, 0};
  LandmarkMap map = with_camera(LandmarkMap(std::move(tables)), camera);
  const std::uint32_t frame = map.observing_frames(LandmarkIndex{1})[0].value;
  const Eigen::Vector3d x =
      map.world_from_camera(FrameIndex{frame}).inverse() * map.landmarks().positions[1];
  MapTables seen = std::move(map).tables();
  seen.observations.pixels[2] = {320.0 + 500.0 * x.x() / x.z(), 240.0 + 500.0 * x.y() / x.z()};
  const MapConsistency result = map_consistency(LandmarkMap(std::move(seen)));
  EXPECT_DOUBLE_EQ(result.reprojection->inlier_share, 1.0 / 3.0);
  ASSERT_EQ(result.by_octave.size(), 1U) << "of octave 1 nothing is in front";
  EXPECT_EQ(result.by_octave[0].octave, 0);
  EXPECT_DOUBLE_EQ(result.by_octave[0].statistics.inlier_share, 0.5);
}

TEST(MapConsistency, TakesFramesWithoutACameraForDepthsOnly) {
  const LandmarkMap map = testing::full_map();  // its frame 1 has no camera
  const MapConsistency result = map_consistency(map);
  const auto frames = map.observations().frames;
  for (std::size_t i = 0; i < frames.size(); ++i) {
    if (frames[i] == FrameIndex{1}) {
      EXPECT_FALSE(result.reprojection_px[i]) << i;
    }
    EXPECT_EQ(result.depth_errors[i].has_value(), map.observations().depths[i].has_value()) << i;
  }
  EXPECT_EQ(result.depth->count, 2U);
}

TEST(MapConsistency, MeasuresPixelsAndCallsInliersThoseBelowTheThreshold) {
  MapTables tables;
  tables.cameras = {{CameraId{0}, "PINHOLE", 640, 480, {500.0, 500.0, 320.0, 240.0}}};
  tables.frames.ids = {FrameId{1}};
  tables.frames.translations = {{0, 0, 0}};
  tables.frames.quaternions = {{1, 0, 0, 0}};
  tables.frames.cameras = {CameraIndex{0}};
  tables.landmarks.ids = {LandmarkId{1}};
  tables.landmarks.positions = {{0, 0, 2}};
  tables.observations.offsets = {0, 1};
  tables.observations.frames = {FrameIndex{0}};
  tables.observations.pixels = {{320.75, 241.0}};
  const LandmarkMap map(std::move(tables));
  const auto inliers = [&](double inlier_px) {
    return map_consistency(map, inlier_px).reprojection->inlier_share;
  };
  EXPECT_EQ(map_consistency(map).reprojection_px[0], 1.25);
  EXPECT_EQ(inliers(1.25), 0.0);
  EXPECT_EQ(inliers(1.26), 1.0);
  EXPECT_EQ(inliers(0.5), 0.0);
}

TEST(MapConsistency, NeedsNoCamerasForDepths) {
  MapTables tables = std::move(exact_map()).tables();
  tables.cameras.clear();
  tables.frames.cameras.clear();
  const MapConsistency result = map_consistency(LandmarkMap(std::move(tables)));
  EXPECT_FALSE(result.reprojection);
  EXPECT_EQ(result.missing_for_reprojection, "cameras of its frames");
  EXPECT_THAT(result.missing_for_depth, IsEmpty());
  ASSERT_TRUE(result.depth);
  EXPECT_LT(result.depth->highest, 1e-9);
}

TEST(MapConsistency, RefusesAThresholdThatIsNoPositiveNumber) {
  for (const double bad : {0.0, -1.0, std::nan(""), std::numeric_limits<double>::infinity()}) {
    EXPECT_THROW(map_consistency(exact_map(), bad), Error) << bad;
  }
}

TEST(MapConsistency, NamesWhatTheMapLacks) {
  const MapConsistency plain = map_consistency(testing::plain_map());
  EXPECT_FALSE(plain.reprojection);
  EXPECT_FALSE(plain.depth);
  EXPECT_EQ(plain.missing_for_reprojection, "cameras of its frames");
  EXPECT_EQ(plain.missing_for_depth, "depths of its observations");
  MapTables cloud;
  cloud.landmarks = testing::plain_tables().landmarks;
  EXPECT_EQ(map_consistency(LandmarkMap(cloud)).missing_for_depth, "observations");
  EXPECT_EQ(map_consistency(LandmarkMap()).missing_for_reprojection, "observations");
}

}  // namespace
}  // namespace cairn
