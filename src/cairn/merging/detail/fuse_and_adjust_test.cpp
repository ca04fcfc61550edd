// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/merging/detail/fuse_and_adjust.hpp"

#include <algorithm>
#include <array>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/adjustment/adjust.hpp"
#include "cairn/map/operations.hpp"
#include "cairn/map/synthetic.hpp"

#include "support/maps.hpp"
#include "support/refusal.hpp"
#include "support/rig_maps.hpp"

namespace cairn::detail {
namespace {

using testing::EqualsMap;
using ::testing::HasSubstr;

SyntheticPair two_sessions(std::uint64_t seed = 3) {
  return synthetic_pair({.seed = seed, .landmarks = 1200, .frames = 30});
}

void set_pose(FrameTable& frames, std::size_t i, const Rigid3& pose) {
  const Eigen::Quaterniond q = pose.quaternion();
  frames.translations[i] = pose.translation();
  frames.quaternions[i] = {q.w(), q.x(), q.y(), q.z()};
}

// As odometry bends a map: the farther along, the more it is turned about its first camera; landmarks go
// with the keyframe that saw them first.
LandmarkMap bent(const LandmarkMap& map, double turn_rad) {
  LandmarkMap copy = map;
  MapTables tables = std::move(copy).tables();
  const Rigid3 start = map.world_from_camera(FrameIndex{0});
  std::vector<Rigid3> moves;
  for (std::uint32_t i = 0; i < map.frame_count(); ++i) {
    const double share = i / static_cast<double>(map.frame_count() - 1);
    const Rigid3 turn =
        Rigid3::from_roll_pitch_yaw(Eigen::Vector3d::Zero(), 0.0, 0.0, share * turn_rad);
    moves.push_back(start * turn * start.inverse());
    set_pose(tables.frames, i, moves.back() * map.world_from_camera(FrameIndex{i}));
  }
  for (std::uint32_t l = 0; l < map.landmark_count(); ++l) {
    const FrameIndex first = map.observing_frames(LandmarkIndex{l}).front();
    tables.landmarks.positions[l] = moves[first.value] * map.landmarks().positions[l];
  }
  return LandmarkMap(std::move(tables));
}

std::vector<PlacedMap> in_place(const LandmarkMap& target, const LandmarkMap& source,
                                const Similarity3& target_from_source) {
  return {{&target, "target", {}}, {&source, "source", target_from_source}};
}

// How many fused pairs are of one point of the scene, and how many are not.
std::pair<std::size_t, std::size_t> right_and_wrong(const SyntheticPair& maps,
                                                    const MergedPlaced& fused) {
  std::set<std::pair<std::uint32_t, std::uint32_t>> shared;
  for (const auto& [source, target] : maps.shared) shared.emplace(source.value, target.value);
  // Pixels tell whose an observation is.
  std::pair<std::size_t, std::size_t> count = {0, 0};
  const LandmarkMap& map = fused.map;
  const auto& parts = map.column(kFusedColumn)->values;
  const auto& from = map.column(kFromLandmarkColumn)->values;
  for (std::uint32_t l = 0; l < map.landmark_count(); ++l) {
    if (parts[l] < 2.0) continue;
    const auto target = static_cast<std::uint32_t>(from[l]);
    const Pixel last = map.observed_pixels(LandmarkIndex{l}).back();
    bool right = false;
    for (const auto& [s, t] : shared) {
      if (t != target) continue;
      right = maps.source.observed_pixels(LandmarkIndex{s}).back() == last;
    }
    ++(right ? count.first : count.second);
  }
  return count;
}

double largest_error(const SyntheticPair& maps, const MergedPlaced& fused) {
  double most = 0.0;
  for (std::uint32_t i = 0; i < maps.source.frame_count(); ++i) {
    const Rigid3 truth = maps.target_from_source * maps.source.world_from_camera(FrameIndex{i});
    const Rigid3 pose = fused.map.world_from_camera(fused.frames[1][i]);
    most = std::max(most, (truth.translation() - pose.translation()).norm());
  }
  return most;
}

TEST(FuseAndAdjust, MatchingAgainFindsWhatABentMapHid) {
  const SyntheticPair maps = two_sessions();
  const LandmarkMap source = bent(maps.source, 0.05);
  const std::vector<PlacedMap> placed = in_place(maps.target, source, maps.target_from_source);
  FusionOptions options;
  options.matching_rounds = 0;
  const MergedPlaced once = fuse_and_adjust(placed, options);
  const MergedPlaced straight =
      fuse_and_adjust(in_place(maps.target, maps.source, maps.target_from_source), options);
  options.matching_rounds = 2;
  const MergedPlaced again = fuse_and_adjust(placed, options);
  const auto [right_once, wrong_once] = right_and_wrong(maps, once);
  const auto [right, wrong] = right_and_wrong(maps, again);
  EXPECT_EQ(again.adjustment->matching_rounds, 2);
  EXPECT_GT(right, right_once + right_once / 10);
  // About as well as if the map had never been bent.
  const auto [right_straight, wrong_straight] = right_and_wrong(maps, straight);
  EXPECT_GT(right, right_straight * 9 / 10) << right_once << " and " << wrong_once << " before";
  EXPECT_LT(wrong, wrong_straight + right_straight / 20) << wrong_straight;
  EXPECT_LT(largest_error(maps, again), 0.005);
  EXPECT_LT(largest_error(maps, again), largest_error(maps, once));
}

TEST(FuseAndAdjust, SameResultWithAnyNumberOfThreads) {
  const SyntheticPair maps = two_sessions();
  const std::vector<PlacedMap> placed = in_place(maps.target, maps.source, maps.target_from_source);
  FusionOptions options;
  options.matching_rounds = 1;
  const MergedPlaced one = fuse_and_adjust(placed, options);
  EXPECT_THAT(fuse_and_adjust(placed, options, {.executor = Executor(2)}).map, EqualsMap(one.map));
}

// Matching again starts from the maps in their own frames, of which the first is any.
TEST(FuseAndAdjust, TheFirstMapMayBeAnywhereInTheWorld) {
  const SyntheticPair maps = two_sessions();
  const Rigid3 moved = Rigid3::from_roll_pitch_yaw({3.0, -2.0, 1.0}, 0.2, -0.1, 1.5);
  std::vector<PlacedMap> placed = in_place(maps.target, maps.source, maps.target_from_source);
  for (PlacedMap& one : placed) one.world_from_map = Similarity3(moved) * one.world_from_map;
  FusionOptions options;
  options.matching_rounds = 1;
  const MergedPlaced fused = fuse_and_adjust(placed, options);
  for (std::uint32_t i = 0; i < maps.target.frame_count(); ++i) {
    const Rigid3 truth = moved * maps.target.world_from_camera(FrameIndex{i});
    const Rigid3 pose = fused.map.world_from_camera(fused.frames[0][i]);
    EXPECT_LT((truth.translation() - pose.translation()).norm(), 0.005) << i;
  }
  EXPECT_GT(fused.maps[1].fused, maps.shared.size() / 2);
}

// Nothing ties it to the first map but its pose, of whose uncertainty the observations know nothing.
TEST(FuseAndAdjust, AMapThatSharesNoLandmarkIsAsUncertainAsItsPose) {
  const SyntheticPair maps = two_sessions();
  std::vector<PlacedMap> placed =
      in_place(maps.target, maps.source, Rigid3(Eigen::Matrix3d::Identity(), {100.0, 0.0, 0.0}));
  placed[1].covariance.topLeftCorner<3, 3>() = 0.01 * Eigen::Matrix3d::Identity();
  placed[1].covariance(5, 5) = 1e-4;
  FusionOptions options;
  options.matching_rounds = 1;
  const LandmarkMap map = fuse_and_adjust(placed, options).map;
  const auto& poses = map.frames().pose_covariances;
  EXPECT_TRUE(poses[0]->isZero(0.0)) << "its frame is the world";
  const Eigen::Vector3d arm =
      map.world_from_camera(FrameIndex{30}).translation() - Eigen::Vector3d(100.0, 0.0, 0.0);
  EXPECT_NEAR((*poses[30])(0, 0), 0.01 + 1e-4 * arm.y() * arm.y(), 1e-9);
  EXPECT_NEAR((*poses[30])(5, 5), 1e-4, 1e-9);
  for (std::uint32_t l = 0; l < map.landmark_count(); ++l) {
    if (map.column(kFromMapColumn)->values[l] != 1.0 || !map.covariance(LandmarkIndex{l})) continue;
    EXPECT_GT(map.covariance(LandmarkIndex{l})->trace(), 0.03) << l;
  }
}

// Each round returns the maps to their own frames and fuses them anew.
TEST(FuseAndAdjust, GravityAndTheGeoreferenceDoNotDependOnTheRounds) {
  const SyntheticPair maps = two_sessions();
  MapTables tables = LandmarkMap(maps.target).tables();
  tables.info.gravity = Eigen::Vector3d(0.0, 0.0, -1.0);
  const LandmarkMap target(std::move(tables));
  const LandmarkMap source =
      with_georeference(maps.source, GeoReference{{47.0, 8.0, 400.0}, 1.0, {0.8, 0.6, 0.0, 0.0}});
  std::vector<PlacedMap> placed = in_place(target, source, maps.target_from_source);
  const Rigid3 moved = Rigid3::from_roll_pitch_yaw({3.0, -2.0, 1.0}, 0.2, -0.1, 1.5);
  for (PlacedMap& one : placed) one.world_from_map = Similarity3(moved) * one.world_from_map;
  FusionOptions options;
  options.adjustment.max_iterations = 1;
  options.adjustment.covariances = false;
  options.matching_rounds = 0;
  const MapInfo once = fuse_and_adjust(placed, options).map.info();
  options.matching_rounds = 1;
  const MapInfo again = fuse_and_adjust(placed, options).map.info();
  EXPECT_LT((*once.gravity - *again.gravity).norm(), 1e-12);
  EXPECT_LT((*once.gravity - moved.rotation() * Eigen::Vector3d(0.0, 0.0, -1.0)).norm(), 1e-12);
  const Eigen::Vector3d x(5.0, -2.0, 1.0);
  EXPECT_NEAR(once.georeference->geodetic(x).latitude_deg,
              again.georeference->geodetic(x).latitude_deg, 1e-11);
}

TEST(FuseAndAdjust, AKeyframeOfTwoMapsBecomesOne) {
  const SyntheticPair maps = two_sessions();
  // The source's first keyframe is the target's last, and has its pose then.
  const auto timed = [](const LandmarkMap& map, double first_s) {
    MapTables tables = LandmarkMap(map).tables();
    tables.frames.timestamps_s.clear();
    for (int i = 0; i < 30; ++i) tables.frames.timestamps_s.push_back(first_s + i);
    return LandmarkMap(std::move(tables));
  };
  const LandmarkMap target = timed(maps.target, 100.0);
  // Which pixels the source has in that image is not known, so they do not speak against it.
  const auto without_pixels_in_first = [](const LandmarkMap& map) {
    MapTables tables = LandmarkMap(map).tables();
    const ObservationTable all = std::exchange(tables.observations, {});
    tables.observations.offsets = {0};
    for (std::size_t i = 0; i < map.landmark_count(); ++i) {
      for (std::uint64_t k = all.offsets[i]; k < all.offsets[i + 1]; ++k) {
        if (all.frames[k] == FrameIndex{0}) continue;
        tables.observations.frames.push_back(all.frames[k]);
        tables.observations.pixels.push_back(all.pixels[k]);
      }
      tables.observations.offsets.push_back(tables.observations.frames.size());
    }
    return LandmarkMap(std::move(tables));
  };
  const LandmarkMap source = without_pixels_in_first(timed(maps.source, 129.0));
  FusionOptions options;
  options.matching_rounds = 1;
  const MergedPlaced fused =
      fuse_and_adjust(in_place(target, source, maps.target_from_source), options);
  EXPECT_EQ(fused.map.frame_count(), 59U);
  EXPECT_EQ(fused.frames[0][29], FrameIndex{29});
  EXPECT_EQ(fused.frames[1][0], FrameIndex{29});
  EXPECT_EQ(fused.frames[1][1], FrameIndex{30});
}

// Two maps have images 4 and 5, each with a camera of its own; the fused frames have that of the larger map.
TEST(FuseAndAdjust, MapsThatShareImagesKeepTheirCameras) {
  MapTables tables = synthetic_map({.seed = 4, .landmarks = 600, .frames = 16}).tables();
  tables.frames.timestamps_s = {};
  for (int i = 0; i < 16; ++i) {
    tables.frames.image_names.push_back(std::to_string(i) + ".jpg");
  }
  const LandmarkMap whole(std::move(tables));
  const auto frames_from_to = [](std::uint32_t begin, std::uint32_t end) {
    std::vector<FrameIndex> frames;
    for (std::uint32_t i = begin; i < end; ++i) frames.push_back(FrameIndex{i});
    return frames;
  };
  const LandmarkMap larger = without_frames(whole, frames_from_to(0, 4));
  std::vector<double> longer = whole.cameras()[0].parameters;
  longer[0] *= 1.001;
  std::vector<double> more = whole.cameras()[0].parameters;
  more.resize(8, 0.0);
  for (const auto& [model, given] :
       {std::pair(std::string("PINHOLE"), longer), std::pair(std::string("OPENCV"), more)}) {
    MapTables part = without_frames(whole, frames_from_to(6, 16)).tables();
    part.cameras[0].model = model;
    part.cameras[0].parameters = given;
    const LandmarkMap smaller(std::move(part));
    ASSERT_TRUE(precedes(larger, smaller));
    const MergedPlaced fused = fuse_and_adjust(in_place(smaller, larger, {}), {});
    ASSERT_EQ(fused.map.frame_count(), 16U) << "two images are of both";
    ASSERT_EQ(fused.map.cameras().size(), 2U) << model;
    EXPECT_TRUE(is_same_lens(fused.map.cameras()[0], smaller.cameras()[0])) << model;
    EXPECT_TRUE(is_same_lens(fused.map.cameras()[1], larger.cameras()[0])) << model;
  }
}

TEST(FuseAndAdjust, ACameraThatTheAdjustedMapLacksStaysAsItIs) {
  const LandmarkMap map = synthetic_map({.seed = 4, .landmarks = 300, .frames = 3});
  MapTables tables = LandmarkMap(map).tables();
  tables.cameras[0].parameters[0] *= 1.05;
  const LandmarkMap adjusted(std::move(tables));
  const LandmarkMap moved =
      moved_with_frames(map, {}, adjusted, std::vector{FrameIndex{0}, FrameIndex{1}, FrameIndex{2}},
                        std::array{std::optional<CameraIndex>()});
  EXPECT_EQ(moved.cameras()[0].parameters, map.cameras()[0].parameters);
}

TEST(FuseAndAdjust, MovedLandmarksKeepTheirPlaceInTheFirstCameraThatSawThem) {
  const SyntheticPair maps = two_sessions();
  // A map of half the size, so that its scale is 2.
  MapTables halved = std::move(LandmarkMap(maps.source)).tables();
  for (auto& t : halved.frames.translations) t *= 0.5;
  for (auto& x : halved.landmarks.positions) x *= 0.5;
  for (auto& c : halved.landmarks.covariances) c *= 0.25;
  auto& depths = halved.observations.depths;
  // NOLINTNEXTLINE(modernize-loop-convert): iterators only read
  for (std::size_t k = 0; k < depths.size(); ++k) depths[k] = 0.5 * depths[k].value();
  const LandmarkMap half(std::move(halved));
  const LandmarkMap adjusted = bent(maps.source, 0.1);
  std::vector<FrameIndex> frames;
  for (std::uint32_t i = 0; i < half.frame_count(); ++i) frames.push_back(FrameIndex{i});
  const LandmarkMap moved = moved_with_frames(half, Similarity3(2.0, Rigid3()), adjusted, frames,
                                              std::array{std::optional(CameraIndex{0})});
  for (std::uint32_t l = 0; l < moved.landmark_count(); ++l) {
    EXPECT_LT((moved.landmarks().positions[l] - adjusted.landmarks().positions[l]).norm(), 1e-12);
    EXPECT_NEAR(moved.landmarks().covariances[l].trace(),
                maps.source.landmarks().covariances[l].trace(), 1e-12);
  }
  EXPECT_EQ(moved.frames().translations, adjusted.frames().translations);
  EXPECT_DOUBLE_EQ(moved.observations().depths[7].value(),
                   maps.source.observations().depths[7].value());
}

LandmarkMap without_depths(const LandmarkMap& map) {
  MapTables tables = LandmarkMap(map).tables();
  tables.observations.depths = {};
  return LandmarkMap(std::move(tables));
}

TEST(FuseAndAdjust, MovedLandmarksWithoutDepthsAreWhereTheirSightsMeet) {
  const LandmarkMap truth = without_depths(
      synthetic_map({.seed = 4, .landmarks = 300, .frames = 12, .pixel_noise_px = 0.0}));
  // Positions and focal length are off; poses and cameras come from the adjustment.
  MapTables tables = LandmarkMap(truth).tables();
  for (auto& x : tables.landmarks.positions) x += Eigen::Vector3d(0.02, -0.03, 0.04);
  tables.cameras.front().parameters.front() *= 1.05;
  const LandmarkMap before(std::move(tables));
  std::vector<FrameIndex> frames;
  for (std::uint32_t i = 0; i < before.frame_count(); ++i) frames.push_back(FrameIndex{i});
  const LandmarkMap moved = moved_with_frames(before, Similarity3(), truth, frames,
                                              std::array{std::optional(CameraIndex{0})});
  EXPECT_EQ(moved.cameras()[0].parameters, truth.cameras()[0].parameters);
  // The synthetic map's positions have noise of their own, its pixels have none: what counts is that these agree.
  std::size_t met = 0;
  std::size_t compared = 0;
  for (std::uint32_t l = 0; l < moved.landmark_count(); ++l) {
    const auto seen_by = moved.observing_frames(LandmarkIndex{l});
    const auto pixels = moved.observed_pixels(LandmarkIndex{l});
    if (seen_by.size() < 3) continue;
    double most = 0.0;
    for (std::size_t k = 0; k < seen_by.size(); ++k) {
      const auto off = reprojection(
          moved.cameras()[0],
          moved.world_from_camera(seen_by[k]).inverse() * moved.landmarks().positions[l],
          pixels[k]);
      most = std::max(most, off ? off->norm() : 1e3);
    }
    ++compared;
    met += most < 0.05 ? 1 : 0;
  }
  EXPECT_GT(compared, 100U);
  EXPECT_GT(met, compared * 9 / 10);
}

// A session as it is reconstructed from photographs alone, without covariances.
LandmarkMap reconstructed(const LandmarkMap& map) {
  MapTables tables = std::move(adjust(without_depths(map)).map).tables();
  tables.landmarks.covariances.clear();
  tables.frames.pose_covariances = {};
  return LandmarkMap(std::move(tables));
}

TEST(FuseAndAdjust, AdjustingReconstructionsKeepsTheLandmarksThatTieThemTogether) {
  const SyntheticPair maps = two_sessions();
  const LandmarkMap source = reconstructed(maps.source);
  const LandmarkMap target = reconstructed(maps.target);
  const std::vector<PlacedMap> placed = in_place(target, source, maps.target_from_source);
  FusionOptions options;
  options.matching_rounds = 0;
  const MergedPlaced once = fuse_and_adjust(placed, options);
  options.matching_rounds = 2;
  for (const bool refine : {false, true}) {
    options.adjustment.refine_intrinsics = refine;
    const MergedPlaced again = fuse_and_adjust(placed, options);
    EXPECT_GT(again.maps[1].fused, once.maps[1].fused) << refine;
    EXPECT_LT(largest_error(maps, again), largest_error(maps, once)) << refine;
  }
}

TEST(FuseAndAdjust, RefusesRoundsOutOfRange) {
  FusionOptions options;
  options.matching_rounds = 11;
  EXPECT_THAT(testing::refusal(ErrorKind::kMisuse, [&] { options.validate(); }),
              HasSubstr("matching_rounds"));
}

TEST(FuseAndAdjust, HoldsRigsThroughAllRounds) {
  const LandmarkMap map = testing::rig_map({.pixel_noise_px = 0.3});
  std::vector<LandmarkIndex> half;
  for (std::uint32_t i = 0; i < map.landmark_count(); i += 2) half.push_back(LandmarkIndex{i});
  const Similarity3 pose(2.0, Rigid3::from_roll_pitch_yaw({1, 2, 3}, 0.1, 0.2, 0.3));
  const LandmarkMap part = transformed(with_landmarks(map, half), pose.inverse());
  const MergedPlaced fused = fuse_and_adjust(in_place(map, part, pose), {});
  EXPECT_EQ(fused.adjustment->matching_rounds, 2);
  EXPECT_LT(fused.adjustment->final_rms_px, 0.5);
  EXPECT_EQ(fused.map.frame_count(), map.frame_count());
  EXPECT_EQ(fused.map.rigs()[0].mounts, map.rigs()[0].mounts);
  EXPECT_LT(testing::off_rig(fused.map), 1e-12);
  EXPECT_TRUE(fused.map.frames().pose_covariances[3].has_value());
}

}  // namespace
}  // namespace cairn::detail
