// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/alignment/detail/bends/map_parts.hpp"

#include <algorithm>
#include <set>
#include <vector>

#include <gtest/gtest.h>

#include "cairn/alignment/detail/prepared_cloud.hpp"
#include "cairn/alignment/prepared_map.hpp"
#include "cairn/map/synthetic.hpp"

namespace cairn::detail {
namespace {

TEST(MapParts, HoldEachLandmarkOnceInTheOrderOfKeyframes) {
  const LandmarkMap map = synthetic_map({.seed = 71, .landmarks = 2500, .frames = 60});
  const std::vector<MapPart> parts = cut_into_parts(map);
  ASSERT_GE(parts.size(), 3U);
  std::set<std::uint32_t> seen;
  std::size_t total = 0;
  for (std::size_t i = 0; i < parts.size(); ++i) {
    EXPECT_LE(parts[i].first, parts[i].middle);
    EXPECT_LE(parts[i].middle, parts[i].last);
    if (i > 0) {
      EXPECT_LT(parts[i - 1].last, parts[i].first);
    }
    for (const LandmarkIndex landmark : parts[i].landmarks) seen.insert(landmark.value);
    total += parts[i].landmarks.size();
    EXPECT_GT(parts[i].landmarks.size(), 200U);
    EXPECT_LT(parts[i].landmarks.size(), 900U);
  }
  EXPECT_EQ(seen.size(), total);
  EXPECT_EQ(total, landmarks_to_align(map).size());
  EXPECT_EQ(parts.front().first, *std::ranges::min_element(map.frames().ids));
  EXPECT_EQ(parts.back().last, *std::ranges::max_element(map.frames().ids));
}

TEST(MapParts, FollowTheTimesOfKeyframesNotTheirIds) {
  const LandmarkMap map = synthetic_map({.seed = 71, .landmarks = 2500, .frames = 60});
  MapTables tables = LandmarkMap(map).tables();
  // The later the keyframe, the smaller its time.
  std::vector<std::optional<double>> times;
  for (std::size_t i = 0; i < map.frame_count(); ++i) {
    times.emplace_back(100.0 - static_cast<double>(i));
  }
  tables.frames.timestamps_s.clear();
  for (const auto& time : times) tables.frames.timestamps_s.push_back(time);
  const LandmarkMap turned(std::move(tables));
  const std::vector<MapPart> parts = cut_into_parts(turned);
  ASSERT_GE(parts.size(), 3U);
  EXPECT_GT(parts.front().first, parts.back().first);
}

TEST(MapParts, AreCutOfALargeMapOnly) {
  const LandmarkMap small = synthetic_map({.seed = 72, .landmarks = 500, .frames = 20});
  EXPECT_LE(cut_into_parts(small).size(), 1U);
  EXPECT_TRUE(PreparedMap(small).parts()->prepared().empty());
  const LandmarkMap large = synthetic_map({.seed = 72, .landmarks = 2000, .frames = 40});
  const PreparedMap prepared(large);
  ASSERT_GE(prepared.parts()->prepared().size(), 2U);
  const auto part_of = prepared.parts()->part_of();
  ASSERT_EQ(part_of.size(), prepared.cloud().size());
  for (std::uint32_t part = 0; part < prepared.parts()->prepared().size(); ++part) {
    EXPECT_EQ(static_cast<std::size_t>(std::count(part_of.begin(), part_of.end(), part)),
              prepared.parts()->prepared()[part].cloud.cloud().size());
  }
}

TEST(MapParts, AreFewAtMost) {
  const LandmarkMap map = synthetic_map({.seed = 73, .landmarks = 3000, .frames = 60});
  EXPECT_LE(cut_into_parts(map, {}, 100).size(), kMostParts);
  EXPECT_TRUE(cut_into_parts(LandmarkMap()).empty());
}

}  // namespace
}  // namespace cairn::detail
