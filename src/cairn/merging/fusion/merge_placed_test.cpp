// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/merging/fusion/merge_placed.hpp"

#include <string>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/core/random.hpp"
#include "cairn/map/folds.hpp"

namespace cairn {
namespace {

using ::testing::IsEmpty;
using ::testing::Not;

constexpr std::uint32_t kImages = 16;

std::uint32_t group_of(std::uint32_t image) {
  return image < 10 ? 0 : 1;
}

// Images 0 to 9 see one side of a can, 10 to 15 the other.
// @param bridge landmarks of the edge between both, which all images see
// @param folded whether the second side lies on the first
LandmarkMap can(int bridge, bool folded, std::uint32_t first = 0, std::uint32_t last = kImages) {
  MapTables tables;
  tables.cameras.push_back({CameraId{1}, "PINHOLE", 640, 480, {500.0, 500.0, 320.0, 240.0}});
  for (std::uint32_t i = first; i < last; ++i) {
    const bool is_moved = group_of(i) == 1 && !folded;
    tables.frames.ids.push_back(FrameId{i});
    tables.frames.translations.emplace_back(0.1 * i, 0.0, is_moved ? 8.0 : 0.0);
    tables.frames.quaternions.push_back(is_moved ? std::array<double, 4>{0.0, 0.0, 1.0, 0.0}
                                                 : std::array<double, 4>{1.0, 0.0, 0.0, 0.0});
    tables.frames.cameras.push_back(CameraIndex{0});
    tables.frames.image_names.push_back(std::to_string(i) + ".jpg");
  }
  tables.observations.offsets.push_back(0);
  for (std::uint64_t l = 0; l < 300; ++l) {
    const bool is_bridge = l < static_cast<std::uint64_t>(bridge);
    const std::uint32_t side = l % 2;
    Random random = Random(9).fork(l);
    tables.landmarks.ids.push_back(LandmarkId{l});
    tables.landmarks.positions.emplace_back(random.uniform(-1.0, 1.0), random.uniform(-1.0, 1.0),
                                            side == 1 && !folded ? 5.0 : 3.0);
    for (std::uint32_t i = first; i < last; ++i) {
      Random in_image = Random(7).fork(l).fork(i);
      const Pixel pixel = {in_image.uniform(0.0, 640.0), in_image.uniform(0.0, 480.0)};
      if (group_of(i) != side && !is_bridge) continue;
      tables.observations.frames.push_back(FrameIndex{i - first});
      tables.observations.pixels.push_back(pixel);
    }
    tables.observations.offsets.push_back(tables.observations.frames.size());
  }
  return LandmarkMap(std::move(tables));
}

std::vector<FrameIndex> frames(std::uint32_t begin, std::uint32_t end) {
  std::vector<FrameIndex> result;
  for (std::uint32_t i = begin; i < end; ++i) result.push_back(FrameIndex{i});
  return result;
}

// The right map lacks images 12 to 15; they are left out of the folded one because they belong to 10 and 11.
TEST(FindFolds, FindsThePartOfTheLooselyConnectedMapThatIsElsewhere) {
  const LandmarkMap right = can(100, false, 0, 12);
  const LandmarkMap folded = can(10, true);
  const std::vector<MapInWorld> maps = {{&right, {}}, {&folded, {}}};
  const auto folds = find_folds(maps);
  EXPECT_FALSE(folds[0]);
  ASSERT_TRUE(folds[1]);
  EXPECT_EQ(folds[1]->frames, frames(10, 16));
  EXPECT_EQ(folds[1]->other, 0U);
  EXPECT_NEAR(folds[1]->apart, 8.0, 1e-9);
  EXPECT_NEAR(folds[1]->turned_deg, 180.0, 1e-6);
  // In any order.
  const auto turned = find_folds(std::vector{maps[1], maps[0]});
  ASSERT_TRUE(turned[0]);
  EXPECT_EQ(turned[0]->frames, frames(10, 16));
  EXPECT_EQ(turned[0]->other, 1U);
  EXPECT_FALSE(turned[1]);
}

TEST(FindFolds, FindsNoneInMapsThatAgree) {
  const LandmarkMap right = can(100, false);
  const LandmarkMap part = can(100, false, 4, 14);
  for (const auto& fold : find_folds(std::vector<MapInWorld>{{&right, {}}, {&part, {}}})) {
    EXPECT_FALSE(fold);
  }
}

TEST(MergePlaced, LeavesOutWhatIsFolded) {
  const LandmarkMap right = can(100, false, 0, 12);
  const LandmarkMap folded = can(10, true);
  const MergedPlaced merged =
      merge_placed(std::vector<PlacedMap>{{&right, "right", {}}, {&folded, "folded", {}}}, {});
  EXPECT_EQ(merged.map.frame_count(), 12U);
  EXPECT_THAT(merged.map.frames().image_names, ::testing::Each(Not(IsEmpty())));
  EXPECT_THAT(merged.frames[1], ::testing::SizeIs(10));
  ASSERT_TRUE(merged.folds[1]);
  EXPECT_EQ(merged.folds[1]->frames, frames(10, 16));
  for (std::size_t i = 0; i < merged.map.landmark_count(); ++i) {
    EXPECT_NE(merged.map.observation_count(LandmarkIndex{static_cast<std::uint32_t>(i)}), 1U);
  }
}

}  // namespace
}  // namespace cairn
