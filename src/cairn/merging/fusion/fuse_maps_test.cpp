// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/merging/fusion/fuse_maps.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numeric>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/LU>
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/core/random.hpp"
#include "cairn/geometry/covariance.hpp"
#include "cairn/map/operations.hpp"
#include "cairn/map/synthetic.hpp"

#include "support/maps.hpp"
#include "support/refusal.hpp"
#include "support/rig_maps.hpp"

namespace cairn {
namespace {

using testing::EqualsMap;
using ::testing::HasSubstr;

// Two sessions, and the same without noise: what is where in truth.
struct Sessions {
  SyntheticPair maps;
  SyntheticPair truth;
};

Sessions sessions(std::uint64_t seed, std::size_t landmarks = 2000, double outliers = 0.0) {
  SyntheticOptions options = {.seed = seed, .landmarks = landmarks, .frames = 30};
  options.outlier_fraction = outliers;
  Sessions result{synthetic_pair(options), {}};
  options.pixel_noise_px = 0.0;
  options.depth_noise_m = 0.0;
  options.outlier_fraction = 0.0;
  result.truth = synthetic_pair(options);
  return result;
}

// The target first, as it is; then the source.
std::vector<PlacedMap> placed(const SyntheticPair& pair) {
  return {{&pair.target, "target", {}}, {&pair.source, "source", pair.target_from_source}};
}

const ColumnValues& values(const LandmarkMap& map, const char* name) {
  return map.column(name)->values;
}

// What the fused map says of pairs, held against the truth.
struct Quality {
  std::size_t right = 0;
  std::size_t wrong = 0;
  double nees = 0.0;           // mean over fused landmarks
  double median_before = 0.0;  // error of the target's landmark, of those fused
  double median_after = 0.0;
};

double median(std::vector<double> values) {
  std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2),
                   values.end());
  return values[values.size() / 2];
}

Quality quality(const Sessions& sessions, const LandmarkMap& fused) {
  const SyntheticPair& maps = sessions.maps;
  const std::set<std::pair<LandmarkIndex, LandmarkIndex>> shared(maps.shared.begin(),
                                                                 maps.shared.end());
  const auto& from_map = values(fused, kFromMapColumn);
  const auto& from_landmark = values(fused, kFromLandmarkColumn);
  Quality result;
  std::vector<double> before;
  std::vector<double> after;
  std::vector<std::uint32_t> partner(maps.target.landmark_count(), 0);
  for (const auto& [source, target] : maps.shared) partner[target.value] = source.value + 1;
  const std::size_t target_frames = maps.target.frame_count();
  for (std::uint32_t i = 0; i < fused.landmark_count(); ++i) {
    if (values(fused, kFusedColumn)[i] < 2.0) continue;
    EXPECT_EQ(from_map[i], 0.0);
    const auto target = static_cast<std::uint32_t>(from_landmark[i]);
    // The second part is known by its observations, which follow the first's.
    const auto pixels = fused.observed_pixels(LandmarkIndex{i});
    const auto frames = fused.observing_frames(LandmarkIndex{i});
    const std::size_t first = maps.target.observation_count(LandmarkIndex{target});
    EXPECT_LT(frames[first - 1].value, target_frames);
    EXPECT_GE(frames[first].value, target_frames);
    const std::uint32_t source = partner[target];
    const bool right =
        source > 0 && maps.source.observed_pixels(LandmarkIndex{source - 1})[0] == pixels[first];
    ++(right ? result.right : result.wrong);
    const Eigen::Vector3d truth = sessions.truth.target.landmarks().positions[target];
    const Eigen::Vector3d error = fused.landmarks().positions[i] - truth;
    result.nees += error.dot(fused.landmarks().covariances[i].inverse() * error);
    after.push_back(error.norm());
    before.push_back((maps.target.landmarks().positions[target] - truth).norm());
  }
  result.nees /= static_cast<double>(after.size());
  result.median_before = median(before);
  result.median_after = median(after);
  return result;
}

TEST(FuseMaps, FusesWhatIsOneAndComesCloserToTheTruth) {
  for (const std::uint64_t seed : {1U, 2U, 3U, 4U}) {
    const Sessions two = sessions(seed);
    const FusionResult result = fuse_maps(placed(two.maps));
    const Quality found = quality(two, result.map);
    const auto shared = static_cast<double>(two.maps.shared.size());
    // Thousands of points on textured spots of a desk: some are nearer to another than their noise.
    EXPECT_GT(static_cast<double>(found.right), 0.7 * shared) << seed;
    EXPECT_LT(static_cast<double>(found.wrong), 0.18 * static_cast<double>(found.right)) << seed;
    EXPECT_LT(found.median_after, 0.85 * found.median_before) << seed;
    EXPECT_GT(found.nees, 2.0) << seed;
    EXPECT_LT(found.nees, 4.0) << seed;
    EXPECT_EQ(result.maps[1].fused, found.right + found.wrong);
    EXPECT_EQ(result.map.landmark_count(), 4000 - result.maps[1].fused);
  }
}

TEST(FuseMaps, IsNotMisledByOutliers) {
  const Sessions two = sessions(5, 2000, 0.1);
  const FusionResult result = fuse_maps(placed(two.maps));
  const Quality found = quality(two, result.map);
  const auto shared = static_cast<double>(two.maps.shared.size());
  EXPECT_GT(static_cast<double>(found.right), 0.7 * shared);
  EXPECT_LT(static_cast<double>(found.wrong), 0.18 * static_cast<double>(found.right));
}

TEST(FuseMaps, PutsAMapOntoItselfThatWasMoved) {
  const LandmarkMap map = synthetic_map({.seed = 2, .landmarks = 800, .frames = 20});
  const Similarity3 moved(2.5, Rigid3::from_roll_pitch_yaw({1.0, -2.0, 0.5}, 0.3, -0.2, 2.0));
  const LandmarkMap other = transformed(map, moved);
  const std::vector<PlacedMap> maps = {{&map, "a", {}}, {&other, "b", moved.inverse()}};
  const FusionResult result = fuse_maps(maps);
  // By their covariances, a few have three others as near as themselves.
  EXPECT_GE(result.maps[1].fused, 780U);
  EXPECT_EQ(result.map.landmark_count(), 1600 - result.maps[1].fused);
  EXPECT_EQ(result.map.frame_count(), 20U);
  for (std::uint32_t i = 0; i < 800; ++i) {
    EXPECT_LT((result.map.landmarks().positions[i] - map.landmarks().positions[i]).norm(), 1e-9);
    if (values(result.map, kFusedColumn)[i] < 2.0) continue;
    EXPECT_EQ(result.map.observation_count(LandmarkIndex{i}),
              map.observation_count(LandmarkIndex{i}));
  }
  for (std::uint32_t i = 0; i < 20; ++i) {
    const Rigid3 a = result.map.world_from_camera(FrameIndex{i});
    EXPECT_LT(a.difference_to(map.world_from_camera(FrameIndex{i})).norm(), 1e-9);
  }
}

// A part of a map, and a larger map that was made from it, as of a merge with another session.
TEST(FuseMaps, CountsWhatAMapAndItsDescendantHaveInCommonOnce) {
  const LandmarkMap map = synthetic_map({.seed = 2, .landmarks = 800, .frames = 20});
  const Similarity3 moved(1.0, Rigid3::from_roll_pitch_yaw({1.0, -2.0, 0.5}, 0.3, -0.2, 2.0));
  const LandmarkMap part = transformed(cut_frames(map, FrameId{3}, FrameId{12}), moved);
  const LandmarkMap session = synthetic_map({.seed = 5, .landmarks = 300, .frames = 7});
  for (const bool with_session : {false, true}) {
    std::vector<PlacedMap> maps = {{&map, "map", {}}};
    if (with_session) maps.push_back({&session, "session", {}});
    const FusionResult without = fuse_maps(maps);
    maps.push_back({&part, "part", moved.inverse()});
    std::vector<std::string> remarks;
    const Execution logged{.log = [&](std::string_view remark) { remarks.emplace_back(remark); }};
    const FusionResult fused = fuse_maps(maps, {}, logged);
    EXPECT_THAT(remarks, ::testing::Contains(
                             HasSubstr("9 images are both in map and in part, and count once")));
    EXPECT_EQ(fused.map.frame_count(), without.map.frame_count());
    std::size_t compared = 0;
    for (std::uint32_t i = 0; i < map.landmark_count(); ++i) {
      const LandmarkIndex landmark{i};
      EXPECT_EQ(fused.map.observation_count(landmark), without.map.observation_count(landmark));
      if (values(fused.map, kFusedColumn)[i] == values(without.map, kFusedColumn)[i]) continue;
      ++compared;
      EXPECT_LT((fused.map.landmarks().positions[i] - without.map.landmarks().positions[i]).norm(),
                1e-9);
      EXPECT_LT((*fused.map.covariance(landmark) - *without.map.covariance(landmark)).norm(),
                1e-3 * without.map.covariance(landmark)->norm());
    }
    EXPECT_GT(compared, 200U);
  }
}

TEST(FuseMaps, ForgetsThatAnObservationDefinesALandmarkThatIsNoLongerOfOneMap) {
  MapTables tables = synthetic_map({.seed = 2, .landmarks = 800, .frames = 20}).tables();
  ObservationTable& all = tables.observations;
  all.sources.assign(all.frames.size(), PixelSource::kPatch);
  all.sigmas_px.assign(all.frames.size(), 0.4);
  for (std::size_t i = 0; i < 800; ++i) {
    all.sources[all.offsets[i]] = PixelSource::kReference;
    all.sigmas_px[all.offsets[i]] = 0.05;
  }
  const LandmarkMap map(std::move(tables));
  std::vector<LandmarkIndex> half;
  for (std::uint32_t i = 0; i < 400; ++i) half.push_back(LandmarkIndex{i});
  const LandmarkMap part = with_landmarks(map, half);
  const std::vector<PlacedMap> maps = {{&map, "a", {}}, {&part, "b", {}}};
  const LandmarkMap fused = fuse_maps(maps).map;
  std::size_t defining = 0;
  for (std::size_t i = 0; i < fused.landmark_count(); ++i) {
    const bool is_of_both = values(fused, kFusedColumn)[i] > 1.0;
    for (std::uint64_t k = fused.observations().offsets[i]; k < fused.observations().offsets[i + 1];
         ++k) {
      const bool defines = fused.observations().sources[k] == PixelSource::kReference;
      EXPECT_FALSE(defines && is_of_both);
      EXPECT_EQ(fused.observations().sources[k].has_value(),
                fused.observations().sigmas_px[k].has_value());
      defining += defines ? 1 : 0;
    }
  }
  EXPECT_GT(defining, 0U) << "of landmarks that stay alone";
}

// A keyframe of a placed map is as uncertain as in its map, and as the map's pose besides, which turns it about the
// map's origin.
TEST(FuseMaps, AddsTheUncertaintyOfAMapsPoseToThoseOfItsKeyframes) {
  MapTables tables = testing::full_tables();
  tables.frames.pose_covariances = {Matrix6d(Matrix6d::Zero()), std::nullopt,
                                    Matrix6d(Matrix6d::Identity() * 1e-6)};
  const LandmarkMap map(tables);
  MapTables far = tables;
  for (Eigen::Vector3d& position : far.landmarks.positions) position.x() += 500.0;
  const LandmarkMap other(far);
  const Similarity3 world_from_other(
      2.0, Rigid3(Eigen::Quaterniond(rotation_exp({0.1, 0.2, -0.4})), {1.0, 2.0, 3.0}));
  Matrix7d placed = Matrix7d::Zero();
  placed.diagonal() << 1e-4, 2e-4, 3e-4, 1e-6, 2e-6, 3e-6, 1e-6;
  const std::vector<PlacedMap> maps = {{&map, "one", {}},
                                       {&other, "two", world_from_other, placed}};
  const LandmarkMap fused = fuse_maps(maps).map;
  const auto& covariances = fused.frames().pose_covariances;
  ASSERT_EQ(covariances.size(), 6U);
  EXPECT_TRUE(covariances[0]->isZero(0.0));
  EXPECT_FALSE(covariances[1]);
  EXPECT_FALSE(covariances[4]);
  // The pose as a function of the map's, moved by hand.
  const Rigid3 in_map = other.world_from_camera(FrameIndex{2});
  const auto placed_pose = [&](const Similarity3& world_from_map) {
    return Rigid3(world_from_map.rigid().quaternion() * in_map.quaternion(),
                  world_from_map * in_map.translation());
  };
  const Rigid3 pose = placed_pose(world_from_other);
  Eigen::Matrix<double, 6, 7> by_map;
  constexpr double kStep = 1e-6;
  for (int i = 0; i < 7; ++i) {
    const Vector7d step = kStep * Vector7d::Unit(i);
    const Similarity3 moved(world_from_other.scale() * std::exp(step[6]),
                            world_from_other.rigid().perturbed(step.head<6>()));
    by_map.col(i) = pose.difference_to(placed_pose(moved)) / kStep;
  }
  Matrix6d expected = by_map * placed * by_map.transpose();
  expected.diagonal().head<3>().array() += 4e-6;
  expected.diagonal().tail<3>().array() += 1e-6;
  EXPECT_LT((*covariances[5] - expected).cwiseAbs().maxCoeff(), 1e-8);
}

TEST(FuseMaps, KeepsAllThatTheMapsHold) {
  const LandmarkMap first = testing::full_map();
  MapTables tables = testing::full_tables();
  tables.info.provenance = {"made elsewhere"};
  tables.cameras[0].width = 100;  // another camera; the second is the same
  for (Eigen::Vector3d& position : tables.landmarks.positions) position.x() += 500.0;
  tables.landmarks.positions[2] = {5.0, 600.0, 7.0};
  const LandmarkMap second(std::move(tables));
  MapTables near = testing::full_tables();
  near.landmarks.positions[2] = {1.0, 6.0, 7.0};
  const LandmarkMap third(std::move(near));
  const std::vector<PlacedMap> maps = {{&third, "one", {}}, {&second, "two", {}}};
  const LandmarkMap map = fuse_maps(maps).map;
  EXPECT_EQ(map.landmark_count(), 8U);
  ASSERT_EQ(map.frame_count(), 6U);
  EXPECT_EQ(map.observation_count(), 10U);
  EXPECT_EQ(map.cameras().size(), 3U);
  EXPECT_EQ(map.info().length_unit, LengthUnit::kFree);
  EXPECT_EQ(map.info().world_frame, "desk");
  EXPECT_FALSE(map.info().uuid);
  EXPECT_THAT(map.info().provenance,
              ::testing::ElementsAre("one: made by hand", "one:  100 % of it\n",
                                     HasSubstr("map 0 of a merge: one, uuid 123e4567"),
                                     "two: made elsewhere",
                                     HasSubstr("frames 3 to 5 are its 3 in their order")));
  EXPECT_EQ(map.frames().timestamps_s[4], 1305031453.374112);
  EXPECT_EQ(map.frames().image_names[3], "two/rgb/1.png") << "the first map has an rgb/1.png too";
  EXPECT_EQ(map.frames().gnss[3], first.frames().gnss[0]);
  EXPECT_EQ(map.frames().cameras[3]->value, 1U);  // the fisheye of both
  EXPECT_EQ(map.frames().cameras[5]->value, 2U);
  EXPECT_EQ(map.landmarks().colors[4], first.landmarks().colors[0]);
  EXPECT_EQ(map.landmarks().descriptors->known[6], 1);
  EXPECT_EQ(map.landmarks().descriptors->bytes[12], 0x1a);
  EXPECT_EQ(values(map, "confidence")[4], 0.25);
  EXPECT_EQ(values(map, kFromLandmarkColumn)[5], 10.0);
  EXPECT_EQ(values(map, kFromMapColumn)[5], 1.0);
  EXPECT_TRUE(std::isnan(values(map, kFromLandmarkColumn)[6]));
  EXPECT_EQ(map.observations().keypoints[5], 12U);
  EXPECT_EQ(map.observations().depths[5], 2.01);
  EXPECT_EQ(map.observations().octaves[6], 1);
  EXPECT_EQ(map.observations().sources[5], PixelSource::kReference) << "of one map alone";
  EXPECT_EQ(map.observations().sigmas_px[6], 0.4);
  EXPECT_FALSE(map.covariance(LandmarkIndex{1}));
  EXPECT_TRUE(map.covariance(LandmarkIndex{0}));
}

// The map cut after a keyframe that both parts have, as odometry cuts mini-maps.
std::pair<LandmarkMap, LandmarkMap> cut_at(const LandmarkMap& map, std::uint32_t frame) {
  std::pair<LandmarkMap, LandmarkMap> parts;
  for (const bool second : {false, true}) {
    MapTables tables = LandmarkMap(map).tables();
    const auto is_kept = [&](std::size_t f) { return second ? f >= frame : f <= frame; };
    const std::uint32_t from = second ? frame : 0;
    FrameTable frames;
    for (std::uint32_t f = 0; f < map.frame_count(); ++f) {
      if (!is_kept(f)) continue;
      frames.ids.push_back(FrameId{f - from});
      frames.translations.push_back(tables.frames.translations[f]);
      frames.quaternions.push_back(tables.frames.quaternions[f]);
      frames.cameras.push_back(CameraIndex{0});
      frames.timestamps_s.push_back(1000.0 + f);
      frames.image_names.push_back("rgb/" + std::to_string(f) + ".png");
    }
    tables.frames = std::move(frames);
    const ObservationTable all = std::exchange(tables.observations, {});
    tables.observations.offsets = {0};
    for (std::size_t i = 0; i < map.landmark_count(); ++i) {
      for (std::uint64_t k = all.offsets[i]; k < all.offsets[i + 1]; ++k) {
        if (!is_kept(all.frames[k].value)) continue;
        tables.observations.frames.push_back(FrameIndex{all.frames[k].value - from});
        tables.observations.pixels.push_back(all.pixels[k]);
      }
      tables.observations.offsets.push_back(tables.observations.frames.size());
    }
    (second ? parts.second : parts.first) = LandmarkMap(std::move(tables));
  }
  return parts;
}

TEST(FuseMaps, CountsTheKeyframeThatNeighbouringMiniMapsShareOnce) {
  const LandmarkMap map = synthetic_map({.seed = 2, .landmarks = 800, .frames = 20});
  const auto [first, second] = cut_at(map, 9);
  ASSERT_EQ(first.frame_count() + second.frame_count(), 21U);
  for (const bool reversed : {false, true}) {
    std::vector<PlacedMap> maps = {{&first, "first", {}}, {&second, "second", {}}};
    if (reversed) std::swap(maps[0], maps[1]);
    const FusionResult fused = fuse_maps(maps);
    EXPECT_EQ(fused.map.frame_count(), 20U);
    EXPECT_EQ(fused.frames[reversed ? 1 : 0].back(), fused.frames[reversed ? 0 : 1].front());
    std::size_t observations = 0;
    for (std::uint32_t l = 0; l < fused.map.landmark_count(); ++l) {
      const auto seen_by = fused.map.observing_frames(LandmarkIndex{l});
      EXPECT_EQ(std::set<FrameIndex>(seen_by.begin(), seen_by.end()).size(), seen_by.size());
      observations += seen_by.size();
    }
    // All but those of the landmarks that are one, in the keyframe that is one.
    EXPECT_LT(observations, first.observation_count() + second.observation_count());
    EXPECT_GE(observations, map.observation_count());
    EXPECT_THAT(
        fused.map.info().provenance,
        ::testing::Contains(HasSubstr(reversed ? "frames 11 to 19 are its other 9 in their "
                                                 "order; frame 0 is its last too"
                                               : "frames 10 to 19 are its other 10 in their "
                                                 "order; frame 9 is its first too")));
  }
}

TEST(FuseMaps, KeepsKeyframesThatAreNotOneAndTheSame) {
  const LandmarkMap map = synthetic_map({.seed = 2, .landmarks = 800, .frames = 20});
  const auto [first, second] = cut_at(map, 9);
  const auto frames_with = [&](const auto& change) {
    MapTables tables = LandmarkMap(second).tables();
    for (Pixel& pixel : tables.observations.pixels) pixel.u += 0.1;  // tracked anew
    change(tables);
    const LandmarkMap other(std::move(tables));
    return fuse_maps(std::vector<PlacedMap>{{&first, "first", {}}, {&other, "other", {}}})
        .map.frame_count();
  };
  EXPECT_EQ(frames_with([](MapTables&) {}), 20U);
  EXPECT_EQ(frames_with([](MapTables& t) { t.frames.timestamps_s[0] = 1008.5; }), 21U);
  EXPECT_EQ(frames_with([](MapTables& t) { t.frames.timestamps_s[0] = std::nullopt; }), 20U)
      << "known by its name and keypoints";
  EXPECT_EQ(frames_with([](MapTables& t) { t.frames.image_names[0] = "left/9.png"; }), 21U);
  EXPECT_EQ(frames_with([](MapTables& t) { t.cameras[0].parameters[0] += 1.0; }), 21U);
  EXPECT_EQ(frames_with([](MapTables& t) {
              for (std::size_t i = 0; i < 11; ++i) t.frames.timestamps_s[i] = 1000.0 + double(i);
              for (std::size_t i = 0; i < 11; ++i) {
                t.frames.image_names[i] = "rgb/" + std::to_string(i) + ".png";
              }
            }),
            21U)
      << "another session that begins at the same time";
}

TEST(FuseMaps, KnowsItsPlaceOnTheEarthFromTheFirstMapThatDoes) {
  const SyntheticPair pair = synthetic_pair({.seed = 3, .landmarks = 300, .frames = 8});
  const GeoReference of_source{{47.0, 8.0, 400.0}, 1.5, {0.8, 0.6, 0.0, 0.0}, {1.0, 2.0, 3.0}};
  const GeoReference of_target{{47.0, 8.0, 420.0}};
  const LandmarkMap source = with_georeference(pair.source, of_source);
  const LandmarkMap target = with_georeference(pair.target, of_target);
  const auto fused = [&](const LandmarkMap& first, const LandmarkMap& second) {
    return fuse_maps(std::vector<PlacedMap>{{&first, "target", {}},
                                            {&second, "source", pair.target_from_source}})
        .map.info()
        .georeference;
  };
  EXPECT_EQ(fused(target, source), of_target);
  EXPECT_EQ(fused(pair.target, pair.source), std::nullopt);
  const auto from_second = fused(pair.target, source);
  ASSERT_TRUE(from_second.has_value());
  const Eigen::Vector3d x(0.5, -0.25, 2.0);
  const GeodeticPosition expected = of_source.geodetic(x);
  const GeodeticPosition found = from_second->geodetic(pair.target_from_source * x);
  EXPECT_NEAR(found.latitude_deg, expected.latitude_deg, 1e-12);
  EXPECT_NEAR(found.longitude_deg, expected.longitude_deg, 1e-12);
  EXPECT_NEAR(found.altitude_m, expected.altitude_m, 1e-7);
}

// Two maps elsewhere in the world become what they become in the first one's frame, moved there.
TEST(FuseMaps, PutsTheFirstMapIntoTheWorldLikeTheOthers) {
  const SyntheticPair pair = synthetic_pair({.seed = 3, .landmarks = 300, .frames = 8});
  MapTables tables = LandmarkMap(pair.target).tables();
  tables.info.world_frame = "desk";
  tables.info.gravity = Eigen::Vector3d(0.0, 0.0, -1.0);
  tables.info.georeference = GeoReference{{47.0, 8.0, 420.0}};
  const LandmarkMap target(std::move(tables));
  const Similarity3 world_from_target(
      1.5, Rigid3::from_roll_pitch_yaw({10.0, -4.0, 2.0}, 0.4, -0.3, 2.0));
  const std::vector<PlacedMap> in_target = {{&target, "target", {}},
                                            {&pair.source, "source", pair.target_from_source}};
  const std::vector<PlacedMap> in_world = {
      {&target, "target", world_from_target},
      {&pair.source, "source", world_from_target * pair.target_from_source}};
  const LandmarkMap expected = transformed(fuse_maps(in_target).map, world_from_target);
  const LandmarkMap found = fuse_maps(in_world).map;
  ASSERT_EQ(found.frame_count(), expected.frame_count());
  for (std::uint32_t i = 0; i < found.frame_count(); ++i) {
    const Rigid3 pose = found.world_from_camera(FrameIndex{i});
    EXPECT_LT(pose.difference_to(expected.world_from_camera(FrameIndex{i})).norm(), 1e-9) << i;
  }
  ASSERT_EQ(found.landmark_count(), expected.landmark_count());
  for (std::uint32_t i = 0; i < found.landmark_count(); ++i) {
    const Eigen::Vector3d& position = found.landmarks().positions[i];
    EXPECT_LT((position - expected.landmarks().positions[i]).norm(), 1e-9) << i;
  }
  EXPECT_LT((*found.info().gravity - *expected.info().gravity).norm(), 1e-12);
  const Eigen::Vector3d x(0.5, -0.25, 2.0);
  EXPECT_NEAR(found.info().georeference->geodetic(x).latitude_deg,
              expected.info().georeference->geodetic(x).latitude_deg, 1e-12);
  EXPECT_FALSE(found.info().world_frame) << "the name is that of the map's own frame";
  // Whichever map knows it.
  MapTables plain = LandmarkMap(pair.source).tables();
  plain.info.gravity.reset();
  const LandmarkMap source(std::move(plain));
  const PlacedMap first = {&source, "source", in_world[1].world_from_map};
  const LandmarkMap turned = fuse_maps(std::vector{first, in_world[0]}).map;
  ASSERT_TRUE(turned.info().gravity);
  EXPECT_LT((*turned.info().gravity - *expected.info().gravity).norm(), 1e-12);
}

TEST(FuseMaps, KeepsTheControlPointsOfAllMaps) {
  const SyntheticPair pair = synthetic_pair({.seed = 3, .landmarks = 300, .frames = 8});
  const auto with = [](LandmarkMap map, std::vector<ControlPoint> points) {
    MapTables tables = std::move(map).tables();
    tables.info.control_points = std::move(points);
    return LandmarkMap(std::move(tables));
  };
  const ControlPoint::View a{"a.jpg", {1.0, 2.0}};
  const ControlPoint::View b{"b.jpg", {3.0, 4.0}};
  const ControlPoint nail{"nail", 47.0, 8.0, 400.0, {a}};
  const ControlPoint higher{"nail", 47.0, 8.0, 401.0, {b}};
  const ControlPoint cross{"cross", 47.1, 8.0, std::nullopt, {}};
  const LandmarkMap first = with(pair.target, {nail});
  const LandmarkMap second = with(pair.source, {cross, {"nail", 47.0, 8.0, 400.0, {b, a}}, higher});
  const auto points =
      fuse_maps(std::vector<PlacedMap>{{&first, "target", {}},
                                       {&second, "source", pair.target_from_source}})
          .map.info()
          .control_points;
  const ControlPoint both{"nail", 47.0, 8.0, 400.0, {a, b}};
  EXPECT_THAT(points, ::testing::ElementsAre(both, cross, higher));
}

LandmarkMap with_image_names(LandmarkMap map, const std::string& format) {
  MapTables tables = std::move(map).tables();
  tables.frames.image_names.clear();
  for (std::size_t i = 0; i < tables.frames.ids.size(); ++i) {
    tables.frames.image_names.push_back(fmt::format(fmt::runtime(format), i));
  }
  return LandmarkMap(std::move(tables));
}

TEST(FuseMaps, TellsImagesOfOneNameApartByTheirMaps) {
  const SyntheticPair pair = synthetic_pair({.seed = 3, .landmarks = 300, .frames = 3});
  const LandmarkMap first = with_image_names(pair.target, "frame_{}.jpg");
  MapTables tables = with_image_names(pair.source, "frame_{}.jpg").tables();
  tables.frames.image_names[2] = "other.jpg";
  tables.info.control_points = {{"nail", 47.0, 8.0, 400.0, {{"frame_1.jpg", {1.0, 2.0}}}}};
  const LandmarkMap second(std::move(tables));
  // Its name is what the first map's are to be.
  const LandmarkMap third = with_image_names(
      synthetic_map({.seed = 9, .landmarks = 300, .frames = 3}), "day one/frame_{}.jpg");
  std::vector<PlacedMap> maps = {{&first, "day one", {}},
                                 {&second, "b", pair.target_from_source},
                                 {&third, "c", pair.target_from_source}};
  std::vector<std::string> remarks;
  const Execution logged{.log = [&](std::string_view remark) { remarks.emplace_back(remark); }};
  const FusionResult two = fuse_maps(std::span(maps).first(2), {}, logged);
  EXPECT_THAT(
      two.map.frames().image_names,
      ::testing::ElementsAre("day_one/frame_0.jpg", "day_one/frame_1.jpg", "day_one/frame_2.jpg",
                             "b/frame_0.jpg", "b/frame_1.jpg", "b/other.jpg"));
  EXPECT_EQ(two.map.info().control_points[0].views[0].image_name, "b/frame_1.jpg");
  EXPECT_THAT(remarks, ::testing::Contains(::testing::AllOf(
                           HasSubstr("names that images of different maps share: 2, e.g. "
                                     "'frame_0.jpg' of day one and b"),
                           HasSubstr("day_one/, b/"))));
  maps[0].name = "day one";
  const auto three = fuse_maps(maps).map.frames().image_names;
  EXPECT_EQ(std::set<std::string>(three.begin(), three.end()).size(), 9U);
  remarks.clear();
  const FusionResult apart = fuse_maps(std::vector{maps[0], maps[2]}, {}, logged);
  EXPECT_EQ(apart.map.frames().image_names[0], "frame_0.jpg") << "no name is shared";
  EXPECT_THAT(remarks, ::testing::IsEmpty());
}

TEST(FuseMaps, MakesOneFrameOfAnImageThatSeveralMapsContain) {
  MapTables tables =
      with_image_names(synthetic_map({.seed = 4, .landmarks = 600, .frames = 12}), "{}.jpg")
          .tables();
  tables.frames.timestamps_s = {};
  const LandmarkMap whole(std::move(tables));
  const LandmarkMap first = cut_frames(whole, FrameId{0}, FrameId{7});
  const Similarity3 pose(0.5, Rigid3(rotation_exp({0.3, -0.2, 0.9}), {1.0, 2.0, 3.0}));
  const LandmarkMap second =
      transformed(cut_frames(whole, FrameId{5}, FrameId{12}), pose.inverse());
  std::vector<std::string> remarks;
  const Execution logged{.log = [&](std::string_view remark) { remarks.emplace_back(remark); }};
  const std::vector<PlacedMap> maps = {{&first, "first", {}}, {&second, "second", pose}};
  const FusionResult result = fuse_maps(maps, {}, logged);
  EXPECT_EQ(result.map.frame_count(), 12U);
  const auto& names = result.map.frames().image_names;
  EXPECT_EQ(std::set<std::string>(names.begin(), names.end()).size(), 12U);
  EXPECT_EQ(result.frames[0][5], result.frames[1][0]);
  EXPECT_THAT(remarks, ::testing::Contains(HasSubstr("2 images are both in first and in second")));
  // An image shows a landmark once.
  const ObservationTable& observations = result.map.observations();
  for (std::size_t i = 0; i < result.map.landmark_count(); ++i) {
    std::set<FrameIndex> seen;
    for (std::uint64_t k = observations.offsets[i]; k < observations.offsets[i + 1]; ++k) {
      EXPECT_TRUE(seen.insert(observations.frames[k]).second) << i;
    }
  }
  const FusionResult turned = fuse_maps(std::vector{maps[1], maps[0]});
  EXPECT_EQ(turned.map.frame_count(), 12U);
  EXPECT_EQ(turned.map.landmark_count(), result.map.landmark_count());
}

// However badly one map is placed; a fence has a pole every few centimetres.
TEST(FuseMaps, FusesLandmarksThatKeypointsOfCommonImagesShow) {
  MapTables tables =
      with_image_names(synthetic_map({.seed = 4, .landmarks = 600, .frames = 12}), "{}.jpg")
          .tables();
  tables.frames.timestamps_s = {};
  tables.landmarks.descriptors.reset();
  const LandmarkMap first(std::move(tables));
  MapTables moved = LandmarkMap(first).tables();
  Random random(3);
  for (Eigen::Vector3d& position : moved.landmarks.positions) {
    position += 0.01 * Eigen::Vector3d(20.0 + random.normal(), random.normal(), random.normal());
  }
  for (Eigen::Vector3d& position : moved.frames.translations) position.x() += 0.2;
  const LandmarkMap second(std::move(moved));
  const FusionResult result =
      fuse_maps(std::vector<PlacedMap>{{&first, "first", {}}, {&second, "second", {}}});
  std::size_t shown = 0;  // landmarks that some image shows
  const auto& offsets = first.observations().offsets;
  for (std::size_t i = 0; i < first.landmark_count(); ++i) shown += offsets[i + 1] > offsets[i];
  EXPECT_EQ(result.map.landmark_count(), 2 * first.landmark_count() - shown);
  EXPECT_EQ(result.map.frame_count(), 12U);
}

// Two programs' maps of the same keypoints: the second adds nothing, whatever it states.
TEST(FuseMaps, TakesPositionAndCovarianceOfRepeatedObservationsFromOneMap) {
  MapTables tables =
      with_image_names(synthetic_map({.seed = 4, .landmarks = 600, .frames = 12}), "{}.jpg")
          .tables();
  tables.frames.timestamps_s = {};
  const LandmarkMap first(std::move(tables));
  MapTables other = LandmarkMap(first).tables();
  Random random(3);
  for (Eigen::Vector3d& position : other.landmarks.positions)
    position.x() += random.uniform(1e-5, 1e-4);
  for (Eigen::Matrix3d& covariance : other.landmarks.covariances) covariance *= 9.0;
  const LandmarkMap second(std::move(other));
  const LandmarkMap fused =
      fuse_maps(std::vector<PlacedMap>{{&first, "first", {}}, {&second, "second", {}}}).map;
  std::size_t repeated = 0;
  for (std::uint32_t i = 0; i < fused.landmark_count(); ++i) {
    if (values(fused, kFusedColumn)[i] < 2.0) continue;
    ++repeated;
    const auto landmark = static_cast<std::size_t>(values(fused, kFromLandmarkColumn)[i]);
    const Eigen::Vector3d& in_first = first.landmarks().positions[landmark];
    const bool is_first = (fused.landmarks().positions[i] - in_first).norm() < 1e-9;
    const LandmarkTable& from = (is_first ? first : second).landmarks();
    EXPECT_LT((fused.landmarks().positions[i] - from.positions[landmark]).norm(), 1e-9) << i;
    EXPECT_LT((fused.landmarks().covariances[i] - from.covariances[landmark]).norm(),
              1e-6 * from.covariances[landmark].norm())
        << i;
  }
  EXPECT_GT(repeated, first.landmark_count() / 2);
}

// The largest map knows only where its cameras were; the next one has another camera than the smallest.
TEST(FuseMaps, KnowsOfACommonImageWhatAnyMapKnowsInAnyOrder) {
  constexpr std::size_t kFrames = 6;
  MapTables tables =
      with_image_names(synthetic_map({.seed = 4, .landmarks = 1200, .frames = kFrames}), "{}.jpg")
          .tables();
  tables.frames.gnss.assign(kFrames, GnssFix{{47.0, 8.0, 400.0}, 2.0});
  const LandmarkMap full(std::move(tables));
  const auto every = [&](std::uint32_t step) {
    std::vector<LandmarkIndex> some;
    for (std::uint32_t i = 0; i < full.landmark_count(); i += step)
      some.push_back(LandmarkIndex{i});
    return with_landmarks(full, some);
  };
  MapTables bare = LandmarkMap(full).tables();
  bare.frames.timestamps_s.clear();
  bare.frames.image_names.clear();
  bare.frames.gnss.clear();
  bare.frames.cameras.clear();
  const LandmarkMap largest(std::move(bare));
  const LandmarkMap middle = every(2);
  MapTables other = every(4).tables();
  other.cameras[0].parameters[0] *= 1.01;
  const LandmarkMap smallest(std::move(other));
  const std::array<const LandmarkMap*, 3> maps = {&largest, &middle, &smallest};
  std::array<std::size_t, 3> order = {0, 1, 2};
  do {
    std::vector<PlacedMap> placed;
    for (const std::size_t m : order) placed.push_back({maps[m], std::to_string(m), {}});
    const LandmarkMap fused = fuse_maps(placed).map;
    const std::string text = placed[0].name + placed[1].name + placed[2].name;
    ASSERT_EQ(fused.frame_count(), kFrames) << text;
    EXPECT_EQ(fused.frames().timestamps_s, full.frames().timestamps_s) << text;
    EXPECT_EQ(fused.frames().image_names, full.frames().image_names) << text;
    EXPECT_EQ(fused.frames().gnss, full.frames().gnss) << text;
    EXPECT_EQ(fused.frames().cameras, full.frames().cameras) << text;
    ASSERT_EQ(fused.cameras().size(), 1U) << text;
    EXPECT_TRUE(is_same_lens(fused.cameras()[0], middle.cameras()[0])) << text;
  } while (std::next_permutation(order.begin(), order.end()));
}

// Both maps have a "0.jpg", so that all names get a prefix; images 5 and 6 are of both maps.
TEST(FuseMaps, NamesTheCommonImagesThatControlPointsAreSeenIn) {
  MapTables tables =
      with_image_names(synthetic_map({.seed = 4, .landmarks = 600, .frames = 12}), "{}.jpg")
          .tables();
  tables.frames.timestamps_s = {};
  const LandmarkMap whole(std::move(tables));
  const ControlPoint::View view{"5.jpg", {1.0, 2.0}};
  MapTables of_first = cut_frames(whole, FrameId{0}, FrameId{7}).tables();
  of_first.info.control_points = {{"nail", 47.0, 8.0, 400.0, {view}}};
  const LandmarkMap first(std::move(of_first));
  MapTables of_second = cut_frames(whole, FrameId{5}, FrameId{12}).tables();
  of_second.frames.image_names.back() = "0.jpg";
  of_second.info.control_points = {{"nail", 47.0, 8.0, 400.0, {view, {"0.jpg", {3.0, 4.0}}}}};
  const LandmarkMap second(std::move(of_second));
  const LandmarkMap fused =
      fuse_maps(std::vector<PlacedMap>{{&first, "a", {}}, {&second, "b", {}}}).map;
  ASSERT_EQ(fused.frame_count(), 12U);
  EXPECT_EQ(fused.frames().image_names[5], "a/5.jpg");
  EXPECT_EQ(fused.frames().image_names[11], "b/0.jpg");
  const ControlPoint nail{
      "nail", 47.0, 8.0, 400.0, {{"a/5.jpg", {1.0, 2.0}}, {"b/0.jpg", {3.0, 4.0}}}};
  EXPECT_THAT(fused.info().control_points, ::testing::ElementsAre(nail));
}

TEST(FuseMaps, TurnsNormals) {
  const SyntheticPair pair = synthetic_pair({.seed = 3, .landmarks = 300, .frames = 3});
  const auto with = [](LandmarkMap map, const std::vector<NamedColumn>& columns) {
    for (const auto& [name, values] : columns) map = with_column(map, name, values);
    return map;
  };
  const auto all = [](const LandmarkMap& map, double value) {
    return std::vector<double>(map.landmark_count(), value);
  };
  const LandmarkMap source =
      with(pair.source,
           {{"nx", all(pair.source, 1)}, {"ny", all(pair.source, 0)}, {"nz", all(pair.source, 0)}});
  std::vector<PlacedMap> maps = {{&pair.target, "a", {}}, {&source, "b", pair.target_from_source}};
  const LandmarkMap fused = fuse_maps(maps).map;
  const Eigen::Vector3d expected = pair.target_from_source.rotation().col(0);
  const std::size_t last = fused.landmark_count() - 1;  // of the second map
  EXPECT_NEAR(fused.column("nx")->values[last], expected.x(), 1e-12);
  EXPECT_NEAR(fused.column("ny")->values[last], expected.y(), 1e-12);
  EXPECT_NEAR(fused.column("nz")->values[last], expected.z(), 1e-12);
}

TEST(FuseMaps, IsTheSameForAnyNumberOfThreads) {
  const Sessions two = sessions(7);
  const LandmarkMap one = fuse_maps(placed(two.maps)).map;
  EXPECT_THAT(fuse_maps(placed(two.maps), {}, {.executor = Executor(2)}).map, EqualsMap(one));
}

LandmarkMap without_covariances(LandmarkMap map) {
  MapTables tables = std::move(map).tables();
  tables.landmarks.covariances.clear();
  return LandmarkMap(std::move(tables));
}

TEST(FuseMaps, GetsAlongWithoutCovariances) {
  Sessions two = sessions(8);
  const LandmarkMap source = without_covariances(two.maps.source);
  const LandmarkMap target = without_covariances(two.maps.target);
  const std::vector<PlacedMap> maps = {{&target, "t", {}},
                                       {&source, "s", two.maps.target_from_source}};
  const FusionResult result = fuse_maps(maps);
  EXPECT_FALSE(result.map.has_covariances());
  EXPECT_GT(result.maps[1].deviation, 0.0005);
  EXPECT_LT(result.maps[1].deviation, 0.02);
  const auto shared = static_cast<double>(two.maps.shared.size());
  EXPECT_GT(static_cast<double>(result.maps[1].fused), 0.45 * shared);
  EXPECT_LT(static_cast<double>(result.maps[1].fused), 1.1 * shared);
}

// n maps of the same 400 separate points, each with errors of its own.
struct Repeated {
  static constexpr double kSigma = 0.01;

  Repeated(std::size_t n, std::optional<double> stated_sigma, std::uint64_t seed) {
    Random random(seed);
    while (truth.size() < 400) {
      const Eigen::Vector3d x(random.uniform(0.0, 20.0), random.uniform(0.0, 20.0),
                              random.uniform(0.0, 20.0));
      const bool apart = std::all_of(truth.begin(), truth.end(), [&](const Eigen::Vector3d& other) {
        return (x - other).norm() > 0.8;
      });
      if (apart) truth.push_back(x);
    }
    for (std::size_t m = 0; m < n; ++m) {
      MapTables tables;
      for (std::size_t i = 0; i < truth.size(); ++i) {
        const Eigen::Vector3d error(random.normal(), random.normal(), random.normal());
        tables.landmarks.ids.push_back(LandmarkId{i});
        tables.landmarks.positions.push_back(truth[i] + kSigma * error);
      }
      if (stated_sigma) {
        tables.landmarks.covariances.assign(
            truth.size(), *stated_sigma * *stated_sigma * Eigen::Matrix3d::Identity());
      }
      maps.emplace_back(std::move(tables));
    }
  }

  FusionResult fused(const std::vector<std::size_t>& order) const {
    std::vector<PlacedMap> placed;
    for (const std::size_t m : order) placed.push_back({&maps[m], std::to_string(m), {}});
    return fuse_maps(placed);
  }

  std::vector<Eigen::Vector3d> truth;
  std::vector<LandmarkMap> maps;
};

// By point: the landmark that combines those of all n maps.
std::map<std::size_t, std::uint32_t> landmarks_of_all(const LandmarkMap& fused, std::size_t n) {
  std::map<std::size_t, std::uint32_t> landmarks;
  for (std::uint32_t i = 0; i < fused.landmark_count(); ++i) {
    if (values(fused, kFusedColumn)[i] < static_cast<double>(n)) continue;
    landmarks[static_cast<std::size_t>(values(fused, kFromLandmarkColumn)[i])] = i;
  }
  return landmarks;
}

// Of each map in the positions of the landmarks that all maps have, by regression of their errors.
Eigen::VectorXd weights_of(const Repeated& repeated, const std::vector<std::size_t>& order,
                           const LandmarkMap& fused) {
  const auto n = static_cast<Eigen::Index>(order.size());
  Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(n, n);
  Eigen::VectorXd right = Eigen::VectorXd::Zero(n);
  const auto of_all = landmarks_of_all(fused, order.size());
  for (const auto& [point, i] : of_all) {
    Eigen::MatrixXd errors(3, n);
    for (Eigen::Index m = 0; m < n; ++m) {
      const LandmarkMap& map = repeated.maps[order[static_cast<std::size_t>(m)]];
      errors.col(m) = map.landmarks().positions[point] - repeated.truth[point];
    }
    normal += errors.transpose() * errors;
    right += errors.transpose() * (fused.landmarks().positions[i] - repeated.truth[point]);
  }
  EXPECT_GT(of_all.size(), 300U);
  return normal.fullPivLu().solve(right);
}

TEST(FuseMaps, WeighsEqualMapsEquallyHoweverMany) {
  for (const std::size_t n : {2U, 3U, 6U, 10U}) {
    for (const std::optional<double> stated : {std::optional<double>(), {1e-3}, {1e-2}}) {
      const Repeated repeated(n, stated, 20 + n);
      std::vector<std::size_t> order(n);
      std::iota(order.begin(), order.end(), std::size_t{0});
      const FusionResult first = repeated.fused(order);
      const Eigen::VectorXd weights = weights_of(repeated, order, first.map);
      const double equal = 1.0 / static_cast<double>(n);
      EXPECT_LT((weights.array() - equal).abs().maxCoeff(), 0.03)
          << n << " maps, stated " << stated.value_or(0.0) << ": " << weights.transpose();
      std::reverse(order.begin(), order.end());
      const auto of_all = landmarks_of_all(first.map, n);
      const FusionResult other = repeated.fused(order);
      double nees = 0.0;
      double variance = 0.0;
      std::size_t compared = 0;
      for (const auto& [point, i] : landmarks_of_all(other.map, n)) {
        if (!of_all.contains(point)) continue;
        ++compared;
        const Eigen::Vector3d& position = other.map.landmarks().positions[i];
        const Eigen::Vector3d& before = first.map.landmarks().positions[of_all.at(point)];
        EXPECT_LT((position - before).norm(), 0.2 * Repeated::kSigma) << point;
        if (!stated) continue;
        const Eigen::Matrix3d& covariance = other.map.landmarks().covariances[i];
        const Eigen::Vector3d error = position - repeated.truth[point];
        nees += error.dot(covariance.inverse() * error);
        variance += covariance.trace() / 3.0;
      }
      EXPECT_GT(compared, 300U);
      if (!stated) continue;
      const auto count = static_cast<double>(compared);
      const double right = Repeated::kSigma * Repeated::kSigma * equal;
      EXPECT_NEAR(variance / count, right, 0.2 * right) << n << ", " << *stated;
      EXPECT_GT(nees / count, 2.4) << n << ", " << *stated;
      EXPECT_LT(nees / count, 3.6) << n << ", " << *stated;
    }
  }
}

// Poses err as their covariances say, which moves the landmarks of a map together.
TEST(FuseMaps, StatesCovariancesThatTheErrorsHaveWhateverTheNumberOfMaps) {
  constexpr int kTrials = 200;
  constexpr double kSigma = 0.01;
  constexpr double kShift = 0.008;
  constexpr double kTurn = 0.001;
  const Rigid3 keyframe = Rigid3::from_roll_pitch_yaw({2.0, 0.5, -0.3}, 0.4, -0.2, 1.0);
  for (const std::size_t n : {2U, 4U, 10U}) {
    Random random(n);
    const auto noise = [&] {
      return Eigen::Vector3d(random.normal(), random.normal(), random.normal());
    };
    double nees = 0.0;
    double count = 0.0;
    double of_keyframes = 0.0;  // each map's, 2 m from its origin, with an error of its own
    for (int trial = 0; trial < kTrials; ++trial) {
      std::vector<Eigen::Vector3d> truth;
      for (int i = 0; i < 64; ++i) {
        truth.emplace_back(2.0 * (i % 4) + random.uniform(0.0, 1.0),
                           2.0 * (i / 4 % 4) + random.uniform(0.0, 1.0),
                           2.0 * (i / 16) + random.uniform(0.0, 1.0));
      }
      std::vector<LandmarkMap> maps;
      std::vector<PlacedMap> placed;
      maps.reserve(n);
      for (std::size_t m = 0; m < n; ++m) {
        MapTables tables;
        for (std::size_t i = 0; i < truth.size(); ++i) {
          tables.landmarks.ids.push_back(LandmarkId{i});
          tables.landmarks.positions.push_back(truth[i] + kSigma * noise());
        }
        tables.landmarks.covariances.assign(truth.size(),
                                            kSigma * kSigma * Eigen::Matrix3d::Identity());
        Vector6d error;
        error << kShift * noise(), kTurn * noise();
        const Matrix6d variances = Vector6d({kShift * kShift, kShift * kShift, kShift * kShift,
                                             kTurn * kTurn, kTurn * kTurn, kTurn * kTurn})
                                       .asDiagonal();
        const Rigid3 seen = keyframe.perturbed(error);
        tables.frames.ids = {FrameId{0}};
        tables.frames.translations = {seen.translation()};
        const Eigen::Quaterniond q = seen.quaternion();
        tables.frames.quaternions = {std::array{q.w(), q.x(), q.y(), q.z()}};
        tables.frames.pose_covariances.push_back(variances);
        PlacedMap& map = placed.emplace_back();
        map.map = &maps.emplace_back(std::move(tables));
        if (m == 0) continue;
        error << kShift * noise(), kTurn * noise();
        map.world_from_map = Similarity3(Rigid3().perturbed(error));
        map.covariance.topLeftCorner<6, 6>() = variances;
      }
      const LandmarkMap fused = fuse_maps(placed).map;
      for (std::uint32_t f = 0; f < n; ++f) {
        of_keyframes += normalised_squared_error(fused.world_from_camera(FrameIndex{f}),
                                                 *fused.frames().pose_covariances[f], keyframe);
      }
      for (const auto& [point, i] : landmarks_of_all(fused, n)) {
        const Eigen::Vector3d error = fused.landmarks().positions[i] - truth[point];
        nees += error.dot(fused.landmarks().covariances[i].inverse() * error);
        count += 1.0;
      }
    }
    EXPECT_GT(count, 60.0 * kTrials) << n;
    EXPECT_GT(nees / count, 3.0 * 0.8) << n;
    EXPECT_LT(nees / count, 3.0 * 1.2) << n;
    EXPECT_NEAR(of_keyframes / (kTrials * static_cast<double>(n)), 6.0, 1.2) << n;
  }
}

TEST(FuseMaps, CountsAMapThatIsGivenTwiceOnce) {
  const Sessions two = sessions(12, 500);
  std::vector<PlacedMap> maps = placed(two.maps);
  const FusionResult once = fuse_maps(maps);
  maps.push_back(maps[1]);
  maps.push_back(maps[0]);
  const FusionResult twice = fuse_maps(maps);
  ASSERT_EQ(twice.map.landmark_count(), once.map.landmark_count());
  for (std::uint32_t i = 0; i < once.map.landmark_count(); ++i) {
    const LandmarkIndex landmark{i};
    EXPECT_EQ(twice.map.landmarks().positions[i], once.map.landmarks().positions[i]);
    EXPECT_EQ(twice.map.covariance(landmark).value(), once.map.covariance(landmark).value());
    EXPECT_EQ(values(twice.map, kFusedColumn)[i], 2.0 * values(once.map, kFusedColumn)[i]);
  }
}

TEST(FuseMaps, KeepsTheRigsOfAllMaps) {
  const LandmarkMap first = testing::rig_map({.seed = 1});
  const LandmarkMap second = testing::rig_map({.seed = 2});
  const Rigid3 pose = Rigid3::from_roll_pitch_yaw({30.0, 6.0, 7.0}, 0.1, 0.2, 0.3);
  const LandmarkMap moved = transformed(second, Similarity3(2.0, pose).inverse());
  for (const double scale : {2.0, 2.5}) {
    const Similarity3 world_from_map(scale, pose);
    const std::vector<PlacedMap> maps = {{&first, "first", {}}, {&moved, "second", world_from_map}};
    const LandmarkMap fused = fuse_maps(maps).map;
    ASSERT_EQ(fused.frame_count(), 32U);
    EXPECT_LT(testing::off_rig(fused), 1e-12);
    // The two cameras of the rig are alike, and stay two. Those of both maps are one if their rigs are.
    const bool is_same_rig = scale == 2.0;
    EXPECT_EQ(fused.rigs().size(), is_same_rig ? 1U : 2U);
    EXPECT_EQ(fused.cameras().size(), is_same_rig ? 3U : 5U);
    const RigidFrames rigid = rigid_frames(fused.rigs(), fused.frames());
    std::size_t leads = 0;
    for (std::size_t i = 0; i < fused.frame_count(); ++i) leads += rigid.leads(i) ? 1 : 0;
    EXPECT_EQ(leads, 18U);
  }
}

TEST(FuseMaps, KeepsARigWhoseImagesTwoMapsHave) {
  const LandmarkMap map = testing::rig_map();
  const Similarity3 world_from_map(1.0, Rigid3::from_roll_pitch_yaw({1, 2, 3}, 0.1, 0.2, 0.3));
  std::vector<LandmarkIndex> half;
  for (std::uint32_t i = 0; i < map.landmark_count(); i += 2) half.push_back(LandmarkIndex{i});
  const LandmarkMap part = transformed(with_landmarks(map, half), world_from_map.inverse());
  const std::vector<PlacedMap> maps = {{&map, "all", {}}, {&part, "part", world_from_map}};
  const LandmarkMap fused = fuse_maps(maps).map;
  EXPECT_EQ(fused.frame_count(), map.frame_count());
  EXPECT_EQ(fused.rigs().size(), 1U);
  EXPECT_LT(testing::off_rig(fused), 1e-12);
}

// Two robots' first images: the clock is at 0, the file is called 0.png, and they see different things.
TEST(FuseMaps, KeepsFirstKeyframesOfEqualTimeAndNameApart) {
  const Sessions two = sessions(13, 300);
  std::vector<LandmarkMap> maps;
  for (const LandmarkMap* map : {&two.maps.target, &two.maps.source}) {
    MapTables tables = cut_frames(*map, map->frames().ids[0], map->frames().ids[1]).tables();
    tables.frames.timestamps_s = {0.0};
    tables.frames.image_names = {"0.png"};
    maps.emplace_back(std::move(tables));
  }
  const std::vector<PlacedMap> apart = {{&maps[0], "a", {}},
                                        {&maps[1], "b", two.maps.target_from_source}};
  EXPECT_EQ(fuse_maps(apart).map.frame_count(), 2U);
  const std::vector<PlacedMap> same = {{&maps[0], "a", {}}, {&maps[0], "b", {}}};
  EXPECT_EQ(fuse_maps(same).map.frame_count(), 1U);
}

TEST(FuseMaps, StatesThePosesUncertaintyOfLandmarksThatComeFromElsewhere) {
  const Sessions two = sessions(9, 500);
  std::vector<PlacedMap> maps = placed(two.maps);
  maps[1].covariance.topLeftCorner<3, 3>() = 0.01 * Eigen::Matrix3d::Identity();
  const LandmarkMap map = fuse_maps(maps).map;
  bool seen = false;
  for (std::uint32_t i = 0; i < map.landmark_count(); ++i) {
    if (values(map, kFromMapColumn)[i] != 1.0) continue;
    seen = true;
    EXPECT_GT(map.covariance(LandmarkIndex{i})->trace(), 0.03);
  }
  EXPECT_TRUE(seen);
}

// The sessions' maps with descriptors: those of one point differ in a few bits, others as random ones do.
LandmarkMap with_descriptors(const LandmarkMap& map, const std::vector<std::uint64_t>& seeds) {
  LandmarkMap copy = map;
  MapTables tables = std::move(copy).tables();
  DescriptorColumn column{"ORB", 32, {}, {}};
  for (const std::uint64_t seed : seeds) {
    Random random(seed);
    column.known.push_back(1);
    for (int i = 0; i < 32; ++i)
      column.bytes.push_back(static_cast<std::uint8_t>(random.index(256)));
  }
  tables.landmarks.descriptors = std::move(column);
  return LandmarkMap(std::move(tables));
}

TEST(FuseMaps, FusesNothingThatLooksDifferent) {
  const Sessions two = sessions(10);
  std::vector<std::uint64_t> source(two.maps.source.landmark_count());
  std::vector<std::uint64_t> target(two.maps.target.landmark_count());
  for (std::size_t i = 0; i < source.size(); ++i) source[i] = 1'000'000 + i;
  for (std::size_t i = 0; i < target.size(); ++i) target[i] = 2'000'000 + i;
  // Every second shared landmark looks the same in both.
  std::size_t alike = 0;
  for (std::size_t i = 0; i < two.maps.shared.size(); i += 2) {
    source[two.maps.shared[i].first.value] = target[two.maps.shared[i].second.value];
    ++alike;
  }
  const LandmarkMap s = with_descriptors(two.maps.source, source);
  const LandmarkMap t = with_descriptors(two.maps.target, target);
  const std::vector<PlacedMap> maps = {{&t, "t", {}}, {&s, "s", two.maps.target_from_source}};
  const std::size_t fused = fuse_maps(maps).maps[1].fused;
  EXPECT_GT(fused, alike * 9 / 10);
  EXPECT_LT(fused, alike * 12 / 10);
}

// As with_descriptors(), with further ones of each landmark, of these seeds.
LandmarkMap with_further(const LandmarkMap& map, const std::vector<std::uint64_t>& seeds,
                         const std::vector<std::vector<std::uint64_t>>& further) {
  MapTables tables = with_descriptors(map, seeds).tables();
  DescriptorColumn& column = *tables.landmarks.descriptors;
  column.further_offsets.push_back(0);
  for (const auto& of_landmark : further) {
    for (const std::uint64_t seed : of_landmark) {
      Random random(seed);
      for (int i = 0; i < 32; ++i) {
        column.further.push_back(static_cast<std::uint8_t>(random.index(256)));
      }
    }
    column.further_offsets.push_back(column.further.size() / 32);
  }
  return LandmarkMap(std::move(tables));
}

TEST(FuseMaps, KeepsTheDescriptorsOfBothAndFusesWhatAnyPairShows) {
  const Sessions two = sessions(10);
  std::vector<std::uint64_t> source(two.maps.source.landmark_count());
  std::vector<std::uint64_t> target(two.maps.target.landmark_count());
  std::vector<std::vector<std::uint64_t>> further(source.size());
  for (std::size_t i = 0; i < source.size(); ++i) source[i] = 1'000'000 + i;
  for (std::size_t i = 0; i < target.size(); ++i) target[i] = 2'000'000 + i;
  // Only a further descriptor of the source shows that both are one landmark.
  for (const auto& [in_source, in_target] : two.maps.shared) {
    further[in_source.value] = {3'000'000 + in_source.value, target[in_target.value]};
  }
  const LandmarkMap s = with_further(two.maps.source, source, further);
  const LandmarkMap t = with_descriptors(two.maps.target, target);
  const std::vector<PlacedMap> maps = {{&t, "t", {}}, {&s, "s", two.maps.target_from_source}};
  const FusionResult result = fuse_maps(maps);
  EXPECT_GT(result.maps[1].fused, two.maps.shared.size() * 9 / 10);
  const DescriptorColumn& column = *result.map.landmarks().descriptors;
  const ColumnValues& parts = values(result.map, kFusedColumn);
  std::size_t of_both = 0;
  for (std::size_t i = 0; i < parts.size(); ++i) {
    EXPECT_LE(column.count(i), kDistinctViews);
    if (parts[i] > 1.0 && column.count(i) == 3) ++of_both;  // the shared one only once
  }
  EXPECT_GT(of_both, result.maps[1].fused * 9 / 10);
  // A landmark that only the source has keeps its own.
  for (std::uint32_t i = 0; i < source.size(); ++i) {
    const auto found = std::find_if(two.maps.shared.begin(), two.maps.shared.end(),
                                    [&](const auto& shared) { return shared.first.value == i; });
    if (found != two.maps.shared.end()) continue;
    EXPECT_EQ(s.landmarks().descriptors->count(i), 1U);
  }
}

TEST(FuseMaps, GivesOneDescriptorEachIfNoMapHasMore) {
  const Sessions two = sessions(10);
  const auto described = [](const LandmarkMap& map, std::uint64_t first) {
    std::vector<std::uint64_t> seeds(map.landmark_count());
    for (std::size_t i = 0; i < seeds.size(); ++i) seeds[i] = first + i;
    return with_descriptors(map, seeds);
  };
  const LandmarkMap s = described(two.maps.source, 1);
  const LandmarkMap t = described(two.maps.target, 1'000'000);
  const std::vector<PlacedMap> maps = {{&t, "t", {}}, {&s, "s", two.maps.target_from_source}};
  EXPECT_FALSE(fuse_maps(maps).map.landmarks().descriptors->has_further());
}

TEST(FuseMaps, RefusesNoMapsAndOptionsOutOfRange) {
  EXPECT_THAT(testing::refusal(ErrorKind::kMisuse, [] { fuse_maps({}); }),
              HasSubstr("at least one map"));
  FusionOptions options;
  options.fusion_probability = 0.2;
  EXPECT_THAT(testing::refusal(ErrorKind::kMisuse, [&] { options.validate(); }),
              HasSubstr("FusionOptions.fusion_probability: 0.2; expected 0.5 to 1"));
}

}  // namespace
}  // namespace cairn
