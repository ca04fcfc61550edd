// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/registration/point_set.hpp"

#include <cmath>
#include <stdexcept>
#include <string_view>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/core/random.hpp"
#include "cairn/map/operations.hpp"

#include "support/maps.hpp"
#include "support/splats.hpp"

namespace cairn {
namespace {

using ::testing::ElementsAre;

// Landmarks 5, 3, 9 with 2, 1 and 3 observations.
LandmarkMap shuffled_map() {
  MapTables tables;
  tables.frames.ids = {FrameId{0}, FrameId{1}, FrameId{2}};
  tables.frames.translations.assign(3, {0, 0, 0});
  tables.frames.quaternions.assign(3, {1, 0, 0, 0});
  tables.landmarks.ids = {LandmarkId{9}, LandmarkId{3}, LandmarkId{5}};
  tables.landmarks.positions = {{9, 0, 0}, {3, 0, 0}, {5, 0, 0}};
  tables.observations.offsets = {0, 3, 4, 6};
  for (const unsigned frame : {0U, 1U, 2U, 0U, 0U, 1U}) {
    tables.observations.frames.push_back(FrameIndex{frame});
    tables.observations.pixels.push_back({0, 0});
  }
  return LandmarkMap(std::move(tables));
}

TEST(PointSet, OrdersLandmarksByIdAndLeavesOutRarelyObservedOnes) {
  const PointSet points = point_set(shuffled_map(), observations_metric());
  EXPECT_THAT(points.positions, ElementsAre(Eigen::Vector3d(5, 0, 0), Eigen::Vector3d(9, 0, 0)));
  EXPECT_THAT(points.confidences, ElementsAre(2.0, 3.0));
}

TEST(PointSet, KeepsAllOnDemandAndHasNoConfidencesWithoutAMetric) {
  const PointSet points = point_set(shuffled_map(), std::nullopt, {.min_observations = 0});
  EXPECT_EQ(points.positions.size(), 3U);
  EXPECT_TRUE(points.confidences.empty());
}

TEST(PointSet, KeepsAllOfAMapThatDoesNotKnowItsObservations) {
  MapTables tables;
  tables.landmarks.ids = {LandmarkId{1}};
  tables.landmarks.positions = {{1, 1, 1}};
  EXPECT_EQ(point_set(LandmarkMap(std::move(tables)), std::nullopt).positions.size(), 1U);
}

// 300 opaque, small splats in a cube of side 2, and after them two of each kind that is left out.
LandmarkMap splats_with_others() {
  constexpr std::size_t kGood = 300;
  LandmarkMap random_map = testing::random_splats(kGood + 8, 1, 1);
  MapTables tables = std::move(random_map).tables();
  LandmarkTable& landmarks = tables.landmarks;
  const auto column = [&](std::string_view name) -> ColumnValues& {
    for (NamedColumn& one : landmarks.columns) {
      if (one.name == name) return one.values;
    }
    throw std::out_of_range("no such column");
  };
  Random random(2);
  for (std::size_t i = 0; i < kGood + 8; ++i) {
    landmarks.positions[i] = {random.uniform(-1, 1), random.uniform(-1, 1), random.uniform(-1, 1)};
    column("opacity").set(i, 2.0);
    for (const char* name : {"scale_0", "scale_1", "scale_2"}) column(name).set(i, -3.0);
  }
  for (std::size_t k = 0; k < 2; ++k) {
    column("opacity").set(kGood + k, -0.1);
    column("scale_1").set(kGood + 2 + k, -3.0 + std::log(5.1));
    landmarks.positions[kGood + 4 + k] = {30.0 + static_cast<double>(k), 0.0, 0.0};
    landmarks.positions[kGood + 6 + k] = {0.0, 4.0, k == 0 ? 0.0 : 1.5};
  }
  set_splat_looks(*splat_columns(landmarks.columns), landmarks);
  return LandmarkMap(std::move(tables));
}

TEST(SelectedSplats, AreOpaqueSmallNearAndAmongOthers) {
  const LandmarkMap map = splats_with_others();
  const auto selection = selected_splats(map);
  ASSERT_TRUE(selection);
  EXPECT_EQ(selection->transparent, 2U);
  EXPECT_EQ(selection->large, 2U);
  EXPECT_EQ(selection->distant, 2U);
  EXPECT_EQ(selection->isolated, 2U);
  ASSERT_EQ(selection->kept.size(), 300U);
  EXPECT_EQ(selection->kept.back(), LandmarkIndex{299});
  EXPECT_EQ(landmarks_to_align(map), selection->kept);
}

TEST(SelectedSplats, AreThoseThatDifferFromTheirNeighboursIfThereAreMany) {
  constexpr std::size_t kAlike = 100;
  LandmarkMap map = testing::random_splats(kMostSplatLandmarks + kAlike, 0, 3);
  for (const char* const name : {"opacity", "scale_0", "scale_1", "scale_2"}) {
    map = with_column(map, name, std::vector<double>(map.landmark_count(), 1.0));
  }
  MapTables tables = std::move(map).tables();
  LandmarkTable& landmarks = tables.landmarks;
  Random random(4);
  for (std::size_t i = 0; i < landmarks.positions.size(); ++i) {
    landmarks.positions[i] = {random.uniform(-1, 1), random.uniform(-1, 1), random.uniform(-1, 1)};
  }
  set_splat_looks(*splat_columns(landmarks.columns), landmarks);
  // The first are in one place, and of one colour.
  for (std::size_t i = 0; i < kAlike; ++i) {
    landmarks.positions[i] *= 0.01;
    landmarks.colors[i] = Color{10, 20, 30};
  }
  const auto selection = selected_splats(LandmarkMap(std::move(tables)));
  EXPECT_EQ(selection->plain, kAlike);
  ASSERT_EQ(selection->kept.size(), kMostSplatLandmarks);
  EXPECT_EQ(selection->kept.front(), LandmarkIndex{kAlike});
}

TEST(SelectedSplats, DoNotDependOnTheFrame) {
  const LandmarkMap map = splats_with_others();
  const Similarity3 motion(7.0, Rigid3::from_roll_pitch_yaw({0, 0, 0}, 0.0, 0.0, std::acos(0.0)));
  EXPECT_EQ(selected_splats(transformed(map, motion))->kept, selected_splats(map)->kept);
}

TEST(SelectedSplats, AreNoneOfOtherMaps) {
  EXPECT_FALSE(selected_splats(testing::plain_map()));
}

}  // namespace
}  // namespace cairn
