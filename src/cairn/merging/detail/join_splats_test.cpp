// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/merging/detail/join_splats.hpp"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/core/error.hpp"
#include "cairn/core/random.hpp"
#include "cairn/map/operations.hpp"
#include "cairn/map/synthetic.hpp"

#include "support/maps.hpp"
#include "support/refusal.hpp"
#include "support/splats.hpp"

namespace cairn {
namespace {

using ::testing::HasSubstr;
using testing::random_splats;

const Similarity3 kSecondPlace(0.5, Rigid3::from_roll_pitch_yaw({1.0, 2.0, 3.0}, 0.5, -0.7, 2.0));

LandmarkMap joined(const LandmarkMap& a, const LandmarkMap& b, const Similarity3& a_from_b,
                   bool thin = true) {
  const std::vector<PlacedMap> maps = {{&a, "a", {}}, {&b, "b", a_from_b}};
  return fuse_maps(maps, {.thin_splats = thin}).map;
}

LandmarkMap with_opacities(const LandmarkMap& map, double (*opacity)(std::size_t)) {
  std::vector<double> values;
  for (std::size_t i = 0; i < map.landmark_count(); ++i) values.push_back(opacity(i));
  return with_column(map, "opacity", std::move(values));
}

// Splats so small that none overlaps another one of its map.
LandmarkMap separate_splats(std::size_t count, std::uint64_t seed) {
  LandmarkMap map = random_splats(count, 2, seed);
  for (const char* name : {"scale_0", "scale_1", "scale_2"}) {
    std::vector<double> values;
    for (const double value : map.column(name)->values) values.push_back(value - 4.0);
    map = with_column(map, name, std::move(values));
  }
  MapTables tables = std::move(map).tables();
  set_splat_looks(*splat_columns(tables.landmarks.columns), tables.landmarks);
  return LandmarkMap(std::move(tables));
}

TEST(JoinSplats, OfAMovedCopyAreTheSplatsThemselves) {
  const LandmarkMap splats = random_splats(100, 3, 1);
  const LandmarkMap copy = transformed(splats, kSecondPlace.inverse());
  const LandmarkMap once = joined(splats, copy, kSecondPlace);
  EXPECT_EQ(once.landmark_count(), splats.landmark_count());
  const LandmarkMap twice = joined(splats, copy, kSecondPlace, false);
  ASSERT_EQ(twice.landmark_count(), 2 * splats.landmark_count());
  for (const NamedColumn& column : splats.landmarks().columns) {
    const double sign = column.name.starts_with("rot") ? -1.0 : 1.0;
    for (std::size_t i = 0; i < splats.landmark_count(); ++i) {
      const double value = twice.column(column.name)->values[splats.landmark_count() + i];
      EXPECT_EQ(twice.column(column.name)->values[i], column.values[i]) << "copied as read";
      EXPECT_TRUE(std::abs(value - column.values[i]) < 1e-12 ||
                  std::abs(value - sign * column.values[i]) < 1e-12)
          << column.name;
    }
  }
  EXPECT_EQ(twice.landmarks().columns.size(), splats.landmarks().columns.size());
}

TEST(JoinSplats, LeaveOutTheDuplicateOfLowerOpacity) {
  const LandmarkMap splats = separate_splats(60, 2);
  const LandmarkMap first =
      with_opacities(splats, [](std::size_t i) { return i % 3 == 0 ? 2.0 : 1.0; });
  const LandmarkMap second = with_opacities(splats, [](std::size_t) { return 1.5; });
  const std::vector<PlacedMap> maps = {{&first, "first", {}}, {&second, "second", {}}};
  const FusionResult result = fuse_maps(maps);
  EXPECT_EQ(result.maps[0].fused, 40U);
  EXPECT_EQ(result.maps[1].fused, 20U);
  ASSERT_EQ(result.map.landmark_count(), 60U);
  for (const double opacity : result.map.column("opacity")->values) EXPECT_GE(opacity, 1.5);
}

TEST(JoinSplats, LeaveTheirMapsEmptyIfTheseMayBe) {
  const LandmarkMap first = random_splats(50, 1, 12);
  const LandmarkMap second = random_splats(60, 2, 13);
  const LandmarkMap expected = joined(first, second, kSecondPlace);
  LandmarkMap spent = first;
  const std::vector<PlacedMap> maps = {
      {.map = &spent, .name = "a", .world_from_map = {}, .disposable = &spent},
      {.map = &second, .name = "b", .world_from_map = kSecondPlace}};
  const FusionResult result = fuse_maps(maps);
  EXPECT_THAT(result.map, testing::EqualsMap(expected));
  EXPECT_EQ(result.maps[0].landmarks, 50U);
  EXPECT_EQ(spent.landmark_count(), 0U);
  EXPECT_EQ(second.landmark_count(), 60U);
}

TEST(JoinSplats, KeepWhatHasNoCounterpart) {
  const LandmarkMap splats = separate_splats(60, 3);
  const LandmarkMap elsewhere =
      transformed(splats, Rigid3::from_roll_pitch_yaw({100.0, 0.0, 0.0}, 0.0, 0.0, 0.0));
  EXPECT_EQ(joined(splats, elsewhere, {}).landmark_count(), 120U);
  const LandmarkMap larger = transformed(splats, Similarity3(3.0, Rigid3()));
  MapTables tables = LandmarkMap(larger).tables();
  tables.landmarks.positions = splats.landmarks().positions;
  EXPECT_EQ(joined(splats, LandmarkMap(std::move(tables)), {}).landmark_count(), 120U)
      << "at the same places, but of three times the size";
}

TEST(JoinSplats, AreTheSameInAnyOrder) {
  const LandmarkMap a = random_splats(200, 1, 4);
  std::vector<LandmarkIndex> some;
  for (std::uint32_t i = 0; i < 150; ++i) some.push_back(LandmarkIndex{i});
  const LandmarkMap b = with_opacities(with_landmarks(a, some), [](std::size_t i) {
    return 0.1 * static_cast<double>(i % 31) - 1.5;
  });
  const auto sorted_opacities = [](const LandmarkMap& map) {
    const ColumnValues& column = map.column("opacity")->values;
    std::vector<double> values(column.begin(), column.end());
    std::sort(values.begin(), values.end());
    return values;
  };
  const LandmarkMap one = joined(a, b, {});
  EXPECT_LT(one.landmark_count(), 350U) << "some are duplicates";
  EXPECT_EQ(sorted_opacities(one), sorted_opacities(joined(b, a, {})));
}

TEST(JoinSplats, OfALowerDegreeKeepTheirColours) {
  const LandmarkMap high = random_splats(20, 3, 6);
  const LandmarkMap low = random_splats(20, 1, 7);
  const LandmarkMap both = joined(low, high, kSecondPlace, false);
  Random random(8);
  for (std::size_t i = 0; i < 20; ++i) {
    const Eigen::Vector3d direction = testing::random_direction(random);
    EXPECT_LT((testing::color_towards(both, 3, i, direction) -
               testing::color_towards(low, 1, i, direction))
                  .norm(),
              1e-12);
    const Eigen::Vector3d turned = kSecondPlace.rigid().rotation() * direction;
    EXPECT_LT((testing::color_towards(both, 3, 20 + i, turned) -
               testing::color_towards(high, 3, i, direction))
                  .norm(),
              1e-12);
  }
}

TEST(JoinSplats, TakeOtherColumnsAlongWithoutInventingValues) {
  const LandmarkMap a = with_column(random_splats(2, 0, 9), "label", {1.0, 2.0});
  const LandmarkMap b = random_splats(2, 0, 10);
  const LandmarkMap both = joined(a, b, {}, false);
  EXPECT_EQ(both.column("label")->values[1], 2.0);
  EXPECT_TRUE(std::isnan(both.column("label")->values[2]));
}

// Splats of 1 cm at positions in metres.
LandmarkMap splats_at(const std::vector<Eigen::Vector3d>& positions, std::uint64_t seed) {
  MapTables tables = random_splats(positions.size(), 0, seed).tables();
  tables.landmarks.positions = positions;
  LandmarkMap map(std::move(tables));
  for (const char* name : {"scale_0", "scale_1", "scale_2"}) {
    map = with_column(map, name, std::vector<double>(positions.size(), std::log(0.01)));
  }
  tables = std::move(map).tables();
  set_splat_looks(*splat_columns(tables.landmarks.columns), tables.landmarks);
  return LandmarkMap(std::move(tables));
}

// Round splats of one size along a line, in standard deviations, with logits of their opacities.
LandmarkMap splats_along(const std::vector<double>& places, const std::vector<double>& opacities) {
  std::vector<Eigen::Vector3d> positions;
  for (const double place : places) positions.emplace_back(0.01 * place, 0.0, 0.0);
  return with_column(splats_at(positions, 1), "opacity", opacities);
}

TEST(JoinSplats, KeepOneOfEachPairOfDuplicates) {
  // The second one is like both others, which are not like each other.
  const LandmarkMap ends = splats_along({0.0, 2.4}, {3.0, 1.0});
  const LandmarkMap middle = splats_along({1.2}, {2.0});
  const std::vector<PlacedMap> maps = {{&ends, "ends", {}}, {&middle, "middle", {}}};
  const FusionResult result = fuse_maps(maps);
  EXPECT_EQ(result.maps[0].fused, 0U) << "the one that the last would be left out for is left out";
  EXPECT_EQ(result.maps[1].fused, 1U);
}

TEST(JoinSplats, KeepWhatLooksDifferent) {
  constexpr std::size_t kCount = 40;
  std::vector<double> places;
  for (std::size_t i = 0; i < kCount; ++i) places.push_back(10.0 * static_cast<double>(i));
  const auto colored = [&](double opacity, double brightness, double of_last) {
    LandmarkMap map = splats_along(places, std::vector<double>(kCount, opacity));
    for (const char* name : {"f_dc_0", "f_dc_1", "f_dc_2"}) {
      std::vector<double> values(kCount, brightness);
      values.back() = of_last;
      map = with_column(map, name, std::move(values));
    }
    MapTables tables = std::move(map).tables();
    set_splat_looks(*splat_columns(tables.landmarks.columns), tables.landmarks);
    return LandmarkMap(std::move(tables));
  };
  const LandmarkMap bright = colored(2.0, 0.5, 0.5);
  const LandmarkMap dark = colored(1.0, -0.3, 1.0);  // but for its last one, of the darker capture
  const std::vector<PlacedMap> maps = {{&bright, "bright", {}}, {&dark, "dark", {}}};
  const FusionResult result = fuse_maps(maps);
  EXPECT_EQ(result.maps[0].fused, 0U);
  EXPECT_EQ(result.maps[1].fused, kCount - 1);
}

// Points halfway from a keyframe to what the map shows.
std::vector<Eigen::Vector3d> points_in_the_air(const LandmarkMap& map, std::size_t count) {
  const Eigen::Vector3d camera = map.world_from_camera(FrameIndex{30}).translation();
  std::vector<Eigen::Vector3d> points;
  for (std::size_t i = 0; i < count; ++i) {
    points.emplace_back(0.5 * (camera + map.landmarks().positions[100 * i]));
  }
  return points;
}

// The map with landmarks that all keyframes see whose images they are in.
LandmarkMap with_seen_points(const LandmarkMap& map, const std::vector<Eigen::Vector3d>& points) {
  MapTables tables = LandmarkMap(map).tables();
  ObservationTable observations;
  observations.offsets = std::move(tables.observations.offsets);
  observations.frames = std::move(tables.observations.frames);
  observations.pixels = std::move(tables.observations.pixels);
  tables.observations = std::move(observations);
  LandmarkTable landmarks;
  landmarks.ids = std::move(tables.landmarks.ids);
  landmarks.positions = std::move(tables.landmarks.positions);
  tables.landmarks = std::move(landmarks);
  for (const Eigen::Vector3d& x : points) {
    tables.landmarks.ids.push_back(LandmarkId{1'000'000 + tables.landmarks.ids.size()});
    tables.landmarks.positions.push_back(x);
    for (std::uint32_t f = 0; f < map.frame_count(); ++f) {
      const Camera& camera = map.cameras()[0];
      const auto pixel = project(camera, map.world_from_camera(FrameIndex{f}).inverse() * x);
      if (!pixel || pixel->u < 0 || pixel->v < 0 || pixel->u > camera.width - 1.0 ||
          pixel->v > camera.height - 1.0) {
        continue;
      }
      tables.observations.frames.push_back(FrameIndex{f});
      tables.observations.pixels.push_back(*pixel);
    }
    tables.observations.offsets.push_back(tables.observations.frames.size());
  }
  return LandmarkMap(std::move(tables));
}

TEST(JoinSplats, NameFloatersThatTheOtherImagesLookThrough) {
  const LandmarkMap first = synthetic_map({.seed = 1});
  const LandmarkMap second = synthetic_map({.seed = 1, .pixel_noise_px = 0.0});
  constexpr std::size_t kFloaters = 20;
  std::vector<Eigen::Vector3d> positions = second.landmarks().positions;
  for (const Eigen::Vector3d& x : points_in_the_air(first, kFloaters)) positions.push_back(x);
  const LandmarkMap a = splats_at(first.landmarks().positions, 1);
  const LandmarkMap b = splats_at(positions, 2);
  std::vector<PlacedMap> maps = {{&a, "a", {}}, {&b, "b", {}}};
  FusionOptions options{.thin_splats = false};
  EXPECT_EQ(fuse_maps(maps, options).maps[1].floaters, std::nullopt) << "no images are known";
  maps[0].model = &first;
  EXPECT_EQ(fuse_maps(maps, options).maps[0].floaters, std::nullopt) << "nor other ones";
  maps[1].model = &second;
  const FusionResult named = fuse_maps(maps, options);
  EXPECT_EQ(named.maps[0].floaters, 0U);
  ASSERT_TRUE(named.maps[1].floaters);
  const std::size_t floaters = *named.maps[1].floaters;
  EXPECT_GE(floaters, 9 * kFloaters / 10);
  EXPECT_LE(floaters, kFloaters);
  EXPECT_EQ(named.map.landmark_count(), a.landmark_count() + b.landmark_count());
  options.drop_floaters = true;
  const LandmarkMap clean = fuse_maps(maps, options).map;
  EXPECT_EQ(clean.landmark_count(), a.landmark_count() + b.landmark_count() - floaters);
  for (std::size_t i = 0; i < a.landmark_count(); ++i) {
    EXPECT_EQ(clean.landmarks().positions[i], a.landmarks().positions[i]);
  }
}

TEST(JoinSplats, DoNotCallAThingAFloaterThatTheOwnImagesShow) {
  const LandmarkMap first = synthetic_map({.seed = 3});
  const std::vector<Eigen::Vector3d> thing = points_in_the_air(first, 20);
  const LandmarkMap second = with_seen_points(first, thing);
  const LandmarkMap a = splats_at(first.landmarks().positions, 1);
  const LandmarkMap b = splats_at(second.landmarks().positions, 2);
  std::vector<PlacedMap> maps = {{&a, "a", {}}, {&b, "b", {}}};
  maps[0].model = &first;
  EXPECT_GE(fuse_maps(maps).maps[1].floaters.value_or(0), 18U)
      << "without the own images, it seems to float";
  maps[1].model = &second;
  EXPECT_EQ(fuse_maps(maps).maps[1].floaters, 0U);
}

TEST(JoinSplats, AreNotDroppedAsFloatersWithoutImages) {
  const LandmarkMap splats = random_splats(4, 0, 11);
  const std::vector<PlacedMap> maps = {{&splats, "a", {}}, {&splats, "b", {}}};
  EXPECT_THAT(
      testing::refusal(ErrorKind::kMisuse, [&] { fuse_maps(maps, {.drop_floaters = true}); }),
      HasSubstr("FusionOptions.drop_floaters: no splat has a model with images"));
}

TEST(JoinSplats, AreNotJoinedWithOthers) {
  const LandmarkMap splats = random_splats(4, 0, 11);
  const LandmarkMap points = testing::plain_map();
  const std::vector<PlacedMap> mixed = {{&splats, "a", {}}, {&points, "b", {}}};
  EXPECT_THAT(testing::refusal(ErrorKind::kInput, [&] { fuse_maps(mixed); }),
              HasSubstr("b: has no Gaussian splats, but a has; expected splats alone"));
  const LandmarkMap unknown = with_column(points, "rot_0", {1.0, 2.0, 3.0});
  const std::vector<PlacedMap> undefined = {{&unknown, "c", {}}, {&unknown, "d", {}}};
  EXPECT_THAT(testing::refusal(ErrorKind::kInput, [&] { fuse_maps(undefined); }),
              HasSubstr("c: has Gaussian splats in no known layout"));
  const std::vector<PlacedMap> one_unknown = {{&splats, "a", {}}, {&unknown, "d", {}}};
  EXPECT_THAT(testing::refusal(ErrorKind::kInput, [&] { fuse_maps(one_unknown); }),
              HasSubstr("d: has Gaussian splats in no known layout"));
}

}  // namespace
}  // namespace cairn
