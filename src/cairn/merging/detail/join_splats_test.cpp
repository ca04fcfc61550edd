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
  const LandmarkMap b = random_splats(150, 1, 5);
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
}

}  // namespace
}  // namespace cairn
