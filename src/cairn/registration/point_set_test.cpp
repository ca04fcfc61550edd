// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/registration/point_set.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

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

}  // namespace
}  // namespace cairn
