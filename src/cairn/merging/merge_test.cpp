// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/merging/merge.hpp"

#include <algorithm>
#include <cstdint>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/geometry/angles.hpp"
#include "cairn/map/operations.hpp"
#include "cairn/map/synthetic.hpp"

#include "support/bent_maps.hpp"
#include "support/maps.hpp"
#include "support/refusal.hpp"

namespace cairn {
namespace {

using testing::EqualsMap;
using ::testing::HasSubstr;

SyntheticPair pair(std::uint64_t seed) {
  return synthetic_pair({.seed = seed, .landmarks = 1200, .frames = 30});
}

TEST(Merge, PutsTwoSessionsIntoTheFirstOnesFrame) {
  const SyntheticPair maps = pair(1);
  const std::vector<MergeInput> inputs = {{"target", &maps.target}, {"source", &maps.source}};
  const MergeResult result = merge(inputs);
  EXPECT_EQ(result.placed(), 2U);
  ASSERT_TRUE(result.map);
  ASSERT_TRUE(result.maps[1].world_from_map);
  const Rigid3 pose = result.maps[1].world_from_map->rigid();
  const Rigid3 error = pose.inverse() * maps.target_from_source;
  EXPECT_LT(error.angle(), 0.002);
  EXPECT_LT(
      (pose * Eigen::Vector3d::Zero() - maps.target_from_source * Eigen::Vector3d::Zero()).norm(),
      0.01);
  EXPECT_EQ(result.map->frame_count(), 60U);
  EXPECT_EQ(result.map->observation_count(),
            maps.source.observation_count() + maps.target.observation_count());
  EXPECT_EQ(result.map->info().world_frame, "synthetic_desk");
  EXPECT_LT(result.map->landmark_count(), 2400 - maps.shared.size() * 9 / 10);
  EXPECT_GT(result.map->landmark_count(), 2400 - maps.shared.size() * 11 / 10);
  const PoseGraph graph = pose_graph(inputs, result);
  graph.validate();
  EXPECT_EQ(graph.links.size(), 1U);
  EXPECT_EQ(graph.links[0].kind, LinkKind::kPlacement);
}

TEST(Merge, AlignsModelsInPlaceOfTheMapsInTheirFrames) {
  const SyntheticPair models =
      synthetic_pair({.seed = 3, .landmarks = 1200, .frames = 30, .overlap = 0.4});
  // Without the landmarks that both have.
  const auto made_of = [](const LandmarkMap& model, const auto& common) {
    std::vector<bool> is_common(model.landmark_count(), false);
    for (const LandmarkIndex index : common) is_common[index.value] = true;
    std::vector<LandmarkIndex> kept;
    for (std::uint32_t i = 0; i < model.landmark_count(); ++i) {
      if (!is_common[i]) kept.push_back(LandmarkIndex{i});
    }
    return with_landmarks(model, kept);
  };
  std::vector<LandmarkIndex> of_target;
  std::vector<LandmarkIndex> of_source;
  for (const auto& [in_source, in_target] : models.shared) {
    of_source.push_back(in_source);
    of_target.push_back(in_target);
  }
  const LandmarkMap target = made_of(models.target, of_target);
  const LandmarkMap source = made_of(models.source, of_source);
  std::vector<MergeInput> inputs = {{"target", &target}, {"source", &source}};
  inputs[0].model = &models.target;
  inputs[1].model = &models.source;
  const MergeResult result = merge(inputs);
  ASSERT_EQ(result.placed(), 2U);
  const std::vector<MergeInput> alone = {{"target", &models.target}, {"source", &models.source}};
  EXPECT_EQ(result.maps[1].world_from_map->matrix(),
            place_maps(alone).maps[1].world_from_map->matrix());
  const Rigid3 error = result.maps[1].world_from_map->rigid().inverse() * models.target_from_source;
  EXPECT_LT(error.angle(), 0.002);
  EXPECT_EQ(result.maps[0].fusion->landmarks, target.landmark_count());
  EXPECT_LE(result.map->landmark_count(), target.landmark_count() + source.landmark_count());
  // A model that lies elsewhere, or is given twice, is refused.
  const LandmarkMap elsewhere = transformed(models.source, Similarity3(2.0, Rigid3()));
  inputs[1].model = &elsewhere;
  EXPECT_THAT(testing::refusal(ErrorKind::kInput, [&] { merge(inputs); }), HasSubstr("source: "));
  inputs[1].model = &models.target;
  EXPECT_THAT(testing::refusal(ErrorKind::kMisuse, [&] { merge(inputs); }),
              HasSubstr("target and source are one map"));
}

TEST(Merge, AdjustmentMakesResidualsSmallerAndKeepsTheFirstFrame) {
  const SyntheticPair maps = pair(2);
  const std::vector<MergeInput> inputs = {{"target", &maps.target}, {"source", &maps.source}};
  MergeOptions options;
  EXPECT_FALSE(merge(inputs, options).adjustment);
  options.adjust = true;
  const MergeResult result = merge(inputs, options);
  ASSERT_TRUE(result.adjustment);
  EXPECT_TRUE(result.adjustment->converged);
  EXPECT_LT(result.adjustment->final_rms_px, result.adjustment->initial_rms_px);
  EXPECT_EQ(result.map->frames().translations[0], maps.target.frames().translations[0]);
  // Poses of synthetic sessions are exact: those of the source are where the truth puts them.
  double most = 0.0;
  for (std::uint32_t i = 0; i < maps.source.frame_count(); ++i) {
    const std::uint32_t merged = static_cast<std::uint32_t>(maps.target.frame_count()) + i;
    const Eigen::Vector3d truth = maps.target_from_source * maps.source.frames().translations[i];
    most = std::max(most, (result.map->frames().translations[merged] - truth).norm());
  }
  EXPECT_LT(most, 0.01);
}

TEST(Merge, MendsABentMap) {
  const SyntheticPair maps = testing::described_pair(64);
  const LandmarkMap crooked = testing::bent(maps.source, 10.0);
  const std::vector<MergeInput> inputs = {{"target", &maps.target}, {"source", &crooked}};
  const MergeResult result = merge(inputs);
  ASSERT_EQ(result.placed(), 2U);
  ASSERT_TRUE(result.maps[1].bend) << "not aligned by parts: " << result.links[0].reason;
  EXPECT_FALSE(result.maps[0].bend);
  EXPECT_NEAR(degrees(result.maps[1].bend->rotation_rad), 8.0, 2.0);
  // Each keyframe is where the map that is not bent has it.
  const auto first = static_cast<std::uint32_t>(maps.target.frame_count());
  for (std::uint32_t i = 0; i < maps.source.frame_count(); ++i) {
    const Rigid3 truth = maps.target_from_source * maps.source.world_from_camera(FrameIndex{i});
    const Rigid3 error = truth.inverse() * result.map->world_from_camera(FrameIndex{first + i});
    EXPECT_LT(degrees(error.angle()), 2.5) << i;
    EXPECT_LT(error.translation().norm(), 0.03) << i;
  }
  // Landmarks of both are found to be the same, as of maps that are not bent.
  const std::vector<MergeInput> sound = {{"target", &maps.target}, {"source", &maps.source}};
  const MergeResult of_sound = merge(sound);
  EXPECT_GT(result.maps[1].fusion->fused, of_sound.maps[1].fusion->fused * 9 / 10);
  EXPECT_FALSE(of_sound.maps[1].bend) << degrees(of_sound.maps[1].bend->rotation_rad);
  MergeOptions options;
  options.straighten = false;
  const MergeResult as_it_is = merge(inputs, options);
  EXPECT_FALSE(as_it_is.maps[1].bend);
  EXPECT_LT(as_it_is.maps[1].fusion->fused, of_sound.maps[1].fusion->fused * 9 / 10);
}

TEST(Merge, MendsTheFirstMapIfTheSecondShowsItToBeBent) {
  const SyntheticPair maps = testing::described_pair(65);
  const LandmarkMap crooked = testing::bent(maps.source, 6.0);
  const std::vector<MergeInput> inputs = {{"source", &crooked}, {"target", &maps.target}};
  const MergeResult result = merge(inputs);
  ASSERT_EQ(result.placed(), 2U);
  ASSERT_TRUE(result.maps[0].bend);
  EXPECT_FALSE(result.maps[1].bend);
  // Keyframes of the two maps are to each other as they are in truth.
  const Rigid3 truth = maps.source.world_from_camera(FrameIndex{0}).inverse() *
                       maps.target_from_source.inverse() *
                       maps.target.world_from_camera(FrameIndex{0});
  const auto second = static_cast<std::uint32_t>(crooked.frame_count());
  const Rigid3 found = result.map->world_from_camera(FrameIndex{0}).inverse() *
                       result.map->world_from_camera(FrameIndex{second});
  EXPECT_LT(degrees((truth.inverse() * found).angle()), 2.0);
}

TEST(Merge, UndoesTheDeformationOfAMapOfFreeScale) {
  const SyntheticPair maps = testing::described_pair(61);
  const LandmarkMap odd = testing::deformed_by(testing::Stretch(maps.source), maps.source);
  const std::vector<MergeInput> inputs = {{"target", &maps.target}, {"source", &odd}};
  const MergeResult result = merge(inputs);
  ASSERT_EQ(result.placed(), 2U) << result.links[0].reason;
  ASSERT_TRUE(result.maps[1].bend);
  EXPECT_FALSE(result.maps[0].bend);
  MergeOptions options;
  options.straighten = false;
  const MergeResult as_it_is = merge(inputs, options);
  EXPECT_FALSE(as_it_is.maps[1].bend);
  EXPECT_GT(result.maps[1].fusion->fused, as_it_is.maps[1].fusion->fused * 11 / 10);
}

TEST(Merge, MapsWithoutCamerasAreMergedButNotAdjusted) {
  SyntheticPair maps = pair(2);
  MapTables tables = std::move(maps.source).tables();
  tables.frames.cameras.clear();
  const LandmarkMap without(std::move(tables));
  const std::vector<MergeInput> inputs = {{"target", &maps.target}, {"source", &without}};
  MergeOptions options;
  options.adjust = true;
  std::vector<std::string> lines;
  const MergeResult result =
      merge(inputs, options, {.log = [&](std::string_view line) { lines.emplace_back(line); }});
  EXPECT_TRUE(result.map);
  EXPECT_FALSE(result.adjustment);
  EXPECT_THAT(lines, ::testing::Contains(HasSubstr("has no camera")));
}

TEST(Merge, LeavesStrangersOutAndSaysWhy) {
  const SyntheticPair maps = pair(1);
  const LandmarkMap stranger = synthetic_map({.seed = 77, .landmarks = 1200, .frames = 30});
  const std::vector<MergeInput> inputs = {
      {"stranger", &stranger}, {"target", &maps.target}, {"source", &maps.source}};
  const MergeResult result = merge(inputs);
  EXPECT_EQ(result.placed(), 2U);
  EXPECT_FALSE(result.maps[0].placed);
  EXPECT_FALSE(result.maps[0].world_from_map);
  EXPECT_THAT(result.maps[0].reason, HasSubstr("aligned with no other map; likeliest with "));
  ASSERT_TRUE(result.maps[0].likeliest_link);
  const Link& likeliest = result.links[*result.maps[0].likeliest_link];
  EXPECT_TRUE(likeliest.target == NodeId{0} || likeliest.source == NodeId{0});
  EXPECT_FALSE(result.maps[1].likeliest_link);
  EXPECT_EQ(result.links.size(), 3U);
  EXPECT_EQ(result.used, (std::vector<bool>{false, false, true}));
  EXPECT_EQ(result.map->frame_count(), 60U);
  const MergeResult none = merge(std::span(inputs).first(2));
  EXPECT_EQ(none.placed(), 0U);
  EXPECT_FALSE(none.map);
}

TEST(Merge, FindsTheScaleOfAMapThatIsOfAnother) {
  const SyntheticPair maps = pair(2);
  const LandmarkMap source =
      with_length_unit(transformed(maps.source, Similarity3(3.0, Rigid3())), LengthUnit::kFree);
  const std::vector<MergeInput> inputs = {{"target", &maps.target}, {"source", &source}};
  const MergeResult result = merge(inputs);
  ASSERT_EQ(result.placed(), 2U) << result.maps[1].reason;
  EXPECT_NEAR(result.maps[1].world_from_map->scale(), 1.0 / 3.0, 0.001);
  EXPECT_EQ(result.map->info().length_unit, LengthUnit::kMetres);
  EXPECT_LT(result.map->landmark_count(), 2400 - maps.shared.size() * 8 / 10);
}

TEST(Merge, IsTheSameForAnyNumberOfThreads) {
  const SyntheticPair maps = pair(3);
  const LandmarkMap third =
      transformed(maps.target, Rigid3::from_roll_pitch_yaw({1.0, 2.0, 3.0}, 1.0, 0.5, -2.0));
  const std::vector<MergeInput> inputs = {
      {"target", &maps.target}, {"source", &maps.source}, {"third", &third}};
  const MergeResult one = merge(inputs);
  ASSERT_EQ(one.placed(), 3U);
  const MergeResult two = merge(inputs, {}, {.executor = Executor(2)});
  EXPECT_THAT(*two.map, EqualsMap(*one.map));
}

TEST(Merge, StopsWhenAsked) {
  const SyntheticPair maps = pair(4);
  std::stop_source stop;
  stop.request_stop();
  const std::vector<MergeInput> inputs = {{"a", &maps.target}, {"b", &maps.source}};
  EXPECT_THAT(testing::refusal(ErrorKind::kCancelled,
                               [&] { merge(inputs, {}, {.stop = stop.get_token()}); }),
              HasSubstr("cancelled"));
}

TEST(Merge, RefusesASingleMap) {
  const SyntheticPair maps = pair(5);
  const std::vector<MergeInput> inputs = {{"a", &maps.target}};
  EXPECT_THAT(testing::refusal(ErrorKind::kMisuse, [&] { merge(inputs); }),
              HasSubstr("at least two maps"));
}

}  // namespace
}  // namespace cairn
