// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/merging/recognition/map_index.hpp"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/core/random.hpp"

#include "support/seen_places.hpp"

namespace cairn {
namespace {

using testing::place;
using testing::seen;

TEST(MapIndex, FindsTheMapOfTheSamePlaceAmongOthers) {
  MapIndex index;
  // Two maps of each of twenty places that share a third of their landmarks.
  for (std::uint64_t i = 0; i < 20; ++i) {
    const std::vector<std::uint8_t> landmarks = place(i, 300);
    EXPECT_EQ(index.add(seen(landmarks, 0, 180, 0.1, 100 + i)), 2 * i);
    index.add(seen(landmarks, 120, 300, 0.1, 200 + i));
  }
  EXPECT_EQ(index.size(), 40U);
  for (std::size_t map = 0; map < index.size(); ++map) {
    const auto found = index.find(map, 3);
    ASSERT_FALSE(found.empty());
    EXPECT_EQ(found.front().map, map ^ 1) << map;
    EXPECT_GT(found.front().score, 20.0);
  }
  const auto of_another = index.find(seen(place(7, 300), 100, 200, 0.05, 9), 2);
  EXPECT_THAT((std::vector{of_another[0].map / 2, of_another[1].map / 2}), ::testing::Each(7U));
}

TEST(MapIndex, FindsNothingBeyondTheDifferenceAllowed) {
  const std::vector<std::uint8_t> landmarks = place(1, 300);
  MapIndex index;
  index.add(seen(landmarks, 0, 300, 0.0, 1));
  EXPECT_EQ(index.find(seen(landmarks, 0, 300, 0.0, 2), 5).size(), 1U);
  EXPECT_TRUE(index.find(seen(landmarks, 0, 300, 0.3, 3), 5).empty());
}

// Histograms of gradients as SIFT's: few of 128 bytes are large. A second view of a landmark changes each by some.
// @param slope by how much each byte is usually larger than the one before
LandmarkMap seen_histograms(std::uint64_t place, std::size_t begin, std::size_t end, double noise,
                            std::uint64_t seed, double slope = 0.0) {
  constexpr std::size_t kBytes = 128;
  Random random(seed);
  MapTables tables;
  DescriptorColumn column{"SIFT", kBytes, {}, {}};
  for (std::size_t i = begin; i < end; ++i) {
    tables.landmarks.ids.push_back(LandmarkId{i});
    tables.landmarks.positions.emplace_back(random.normal(), random.normal(), random.normal());
    column.known.push_back(1);
    Random of_landmark = Random(place).fork(i);
    for (std::size_t k = 0; k < kBytes; ++k) {
      const double usual = k % 8 < 4 ? 60.0 : 20.0;  // not all bytes are alike
      const double own = -usual * std::log(of_landmark.uniform(1e-6, 1.0));
      const double value =
          slope > 0.0 ? slope * static_cast<double>(k) + 0.15 * std::min(own, 200.0) : own;
      column.bytes.push_back(
          static_cast<std::uint8_t>(std::clamp(value + noise * random.normal(), 0.0, 255.0)));
    }
  }
  tables.landmarks.descriptors = std::move(column);
  return LandmarkMap(std::move(tables));
}

TEST(MapIndex, FindsTheSamePlaceByDescriptorsOfBytes) {
  MapIndex index;
  for (std::uint64_t i = 0; i < 50; ++i) {
    index.add(seen_histograms(i, 0, 180, 15.0, 100 + i));
    index.add(seen_histograms(i, 120, 300, 15.0, 200 + i));
  }
  for (std::size_t map = 0; map < index.size(); ++map) {
    EXPECT_TRUE(index.holds(map));
    const auto found = index.find(map, 3);
    ASSERT_FALSE(found.empty()) << map;
    EXPECT_EQ(found.front().map, map ^ 1) << map;
  }
  const auto of_another = index.find(seen_histograms(7, 100, 200, 15.0, 9), 2);
  ASSERT_EQ(of_another.size(), 2U);
  EXPECT_THAT((std::vector{of_another[0].map / 2, of_another[1].map / 2}), ::testing::Each(7U));
}

// Of such bytes, most sums exceed most others whatever the landmark.
TEST(MapIndex, FindsTheSamePlaceWhereTheBytesDifferInTheirMeans) {
  MapIndex index;
  for (std::uint64_t i = 0; i < 20; ++i) {
    index.add(seen_histograms(i, 0, 180, 1.5, 100 + i, 1.7));
    index.add(seen_histograms(i, 120, 300, 1.5, 200 + i, 1.7));
  }
  for (std::size_t map = 0; map < index.size(); ++map) {
    const auto found = index.find(map, 1);
    ASSERT_FALSE(found.empty()) << map;
    EXPECT_EQ(found.front().map, map ^ 1) << map;
    EXPECT_GT(found.front().score, 50.0);
  }
}

TEST(MapIndex, MapsWithoutLikeDescriptorsAreNeverFound) {
  const std::vector<std::uint8_t> landmarks = place(1, 50);
  MapIndex index;
  index.add(LandmarkMap());
  index.add(seen(landmarks, 0, 50, 0.0, 1));
  index.add(seen(landmarks, 0, 50, 0.0, 1, "SIFT"));
  index.add(seen(landmarks, 0, 50, 0.0, 1));
  EXPECT_FALSE(index.holds(0));
  EXPECT_TRUE(index.holds(1));
  EXPECT_FALSE(index.holds(2));
  EXPECT_TRUE(index.find(std::size_t{0}, 5).empty());
  const auto found = index.find(std::size_t{1}, 5);
  ASSERT_EQ(found.size(), 1U);
  EXPECT_EQ(found.front().map, 3U);
}

TEST(MapIndex, MapsWithOnlyUnknownDescriptorsFindNothingAndDoNotSetTheKind) {
  const std::vector<std::uint8_t> landmarks = place(1, 50);
  MapTables tables = seen(landmarks, 0, 50, 0.0, 1, "BRISK").tables();
  tables.landmarks.descriptors->known.assign(50, 0);
  tables.landmarks.descriptors->bytes.assign(50 * testing::kDescriptorBytes, 0);
  const LandmarkMap unknown(std::move(tables));
  MapIndex index;
  index.add(unknown);
  EXPECT_TRUE(index.find(std::size_t{0}, 5).empty());
  EXPECT_TRUE(index.find(unknown, 5).empty());
  index.add(seen(landmarks, 0, 50, 0.0, 1));
  EXPECT_FALSE(index.holds(0));
  EXPECT_TRUE(index.holds(1));
  EXPECT_TRUE(index.find(unknown, 5).empty());
  EXPECT_EQ(index.find(seen(landmarks, 0, 50, 0.0, 2), 5).size(), 1U);
}

TEST(MapIndex, TakesTheMostObservedLandmarks) {
  const std::vector<std::uint8_t> landmarks = place(1, 1000);
  MapIndex index;
  index.add(seen(landmarks, 0, 1000, 0.0, 1));
  // Without observations the first count.
  EXPECT_EQ(index.find(seen(landmarks, 0, 600, 0.0, 1), 1).size(), 1U);
  EXPECT_TRUE(index.find(seen(landmarks, 600, 1000, 0.0, 1), 1).empty());
}

}  // namespace
}  // namespace cairn
