// SPDX-License-Identifier: BSD-3-Clause
#include <cmath>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/evaluation/map_consistency.hpp"
#include "cairn/map/operations.hpp"
#include "cairn/map/synthetic.hpp"

#include "support/splats.hpp"

namespace cairn {
namespace {

using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

MapTables tables() {
  return std::move(synthetic_map({.landmarks = 50, .frames = 5})).tables();
}

TEST(MapDefects, ACompleteMapHasNone) {
  EXPECT_THAT(map_defects(LandmarkMap(tables())), IsEmpty());
}

TEST(MapDefects, NamesWhatAMapLacks) {
  MapTables bare;
  bare.landmarks.ids = {LandmarkId{1}};
  bare.landmarks.positions = {Eigen::Vector3d::Zero()};
  EXPECT_THAT(map_defects(LandmarkMap(std::move(bare))),
              ElementsAre(HasSubstr("no observations"), HasSubstr("no covariances")));
  EXPECT_THAT(map_defects(LandmarkMap(MapTables())), ElementsAre(HasSubstr("no landmarks")));
  EXPECT_THAT(map_defects(testing::random_splats(20, 0, 1)), IsEmpty())
      << "splats have no observations anyway";
}

TEST(MapDefects, CountsLandmarksAtOnePosition) {
  MapTables changed = tables();
  const std::vector<LandmarkIndex> twice = landmarks_observed(LandmarkMap(tables()), 2);
  ASSERT_GE(twice.size(), 2U);
  auto& positions = changed.landmarks.positions;
  positions[twice[1].value] = positions[twice[0].value];
  EXPECT_THAT(map_defects(LandmarkMap(std::move(changed))),
              ElementsAre(HasSubstr("lie exactly where another does: 1")));
}

TEST(MapDefects, NamesTheGridOfPositions) {
  const auto with_grid = [](int axes) {
    MapTables changed = std::move(synthetic_map({.landmarks = 500, .frames = 5})).tables();
    for (Eigen::Vector3d& position : changed.landmarks.positions) {
      for (int axis = 0; axis < axes; ++axis)
        position[axis] = 0.05 * std::round(20.0 * position[axis]);
    }
    return map_defects(LandmarkMap(std::move(changed)));
  };
  EXPECT_THAT(with_grid(3), Contains(HasSubstr("lie on a grid of 0.05 x 0.05 x 0.05")));
  EXPECT_THAT(with_grid(2), Contains(HasSubstr("lie on a grid of 0.05 x 0.05 x 0,")));
  EXPECT_THAT(with_grid(1), Not(Contains(HasSubstr("grid"))));
}

TEST(KeyframeUncertainties, AreThoseOfTheWorstKeyframeAndTheGreatestStep) {
  MapTables changed = tables();
  EXPECT_FALSE(keyframe_uncertainties(LandmarkMap(MapTables(changed))));
  const std::vector<FrameId> ids = changed.frames.ids;
  changed.frames.pose_covariances.clear();
  for (const double variance : {0.0, 1.0, 5.0, 6.0, 4.0}) {
    changed.frames.pose_covariances.push_back(Matrix6d(variance * Matrix6d::Identity()));
  }
  const auto found = keyframe_uncertainties(LandmarkMap(std::move(changed)));
  ASSERT_TRUE(found);
  EXPECT_EQ(found->worst, ids[3]);
  EXPECT_DOUBLE_EQ(found->of_worst.angle_rad, std::sqrt(18.0));
  EXPECT_EQ(found->step, std::pair(ids[1], ids[2]));
  EXPECT_DOUBLE_EQ(found->of_step.length, std::sqrt(12.0));
}

}  // namespace
}  // namespace cairn
