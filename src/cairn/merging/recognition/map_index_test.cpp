// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/merging/recognition/map_index.hpp"

#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

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
