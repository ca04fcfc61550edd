// SPDX-License-Identifier: BSD-3-Clause
#include <vector>

#include <gtest/gtest.h>

#include "cairn/atlas/queries.hpp"

#include "support/atlas_state.hpp"

namespace cairn {
namespace {

using testing::pose_of;

AtlasState with_nodes(const std::vector<std::uint64_t>& ids) {
  AtlasState state;
  for (const std::uint64_t id : ids) state.nodes[NodeId{id}] = testing::node_of(id);
  return state;
}

TEST(AtlasDifference, OfAStateWithItselfIsEmpty) {
  AtlasState state = with_nodes({1, 2});
  state.links[LinkId{1}] = {};
  state.poses[NodeId{1}] = pose_of(1, 1);
  state.agrees[LinkId{1}] = false;
  EXPECT_TRUE(difference(state, state).empty());
}

TEST(AtlasDifference, NamesWhatWasAddedAndRemoved) {
  AtlasState before = with_nodes({1, 2});
  AtlasState after = with_nodes({2, 3});
  before.links[LinkId{1}] = {};
  before.links[LinkId{2}] = {};
  after.links[LinkId{2}] = {};
  after.links[LinkId{4}] = {};
  before.poses[NodeId{1}] = pose_of(1, 1);
  after.poses[NodeId{3}] = pose_of(3, 2);
  const AtlasDifference found = difference(before, after);
  EXPECT_EQ(found.added_nodes, (std::vector{NodeId{3}}));
  EXPECT_EQ(found.removed_nodes, (std::vector{NodeId{1}}));
  EXPECT_EQ(found.added_links, (std::vector{LinkId{4}}));
  EXPECT_EQ(found.removed_links, (std::vector{LinkId{1}}));
  EXPECT_EQ(found.placed, (std::vector{NodeId{3}}));
  EXPECT_EQ(found.no_longer_placed, (std::vector{NodeId{1}}));
  EXPECT_TRUE(found.moved.empty());
}

TEST(AtlasDifference, EachPartAloneIsOne) {
  EXPECT_TRUE(AtlasDifference().empty());
  const auto is_empty_with = [](auto AtlasDifference::*part) {
    AtlasDifference difference;
    (difference.*part).resize(1);
    return difference.empty();
  };
  EXPECT_FALSE(is_empty_with(&AtlasDifference::added_nodes));
  EXPECT_FALSE(is_empty_with(&AtlasDifference::removed_nodes));
  EXPECT_FALSE(is_empty_with(&AtlasDifference::added_links));
  EXPECT_FALSE(is_empty_with(&AtlasDifference::removed_links));
  EXPECT_FALSE(is_empty_with(&AtlasDifference::placed));
  EXPECT_FALSE(is_empty_with(&AtlasDifference::no_longer_placed));
  EXPECT_FALSE(is_empty_with(&AtlasDifference::moved));
  EXPECT_FALSE(is_empty_with(&AtlasDifference::now_contradicted));
  EXPECT_FALSE(is_empty_with(&AtlasDifference::no_longer_contradicted));
}

TEST(AtlasDifference, TellsHowFarTheMiddleOfAMapMovedAndTurned) {
  AtlasState before = with_nodes({1, 2, 3});
  AtlasState after = before;
  for (AtlasState* const state : {&before, &after}) {
    state->nodes.at(NodeId{2}).extent.centre = {10.0, 0.0, 0.0};
    state->poses[NodeId{1}] = pose_of(1, 1);
  }
  before.poses[NodeId{2}] = pose_of(2, 1);
  before.poses[NodeId{3}] = pose_of(3, 1);
  // About the middle: turned, and then 3 m and 4 m aside.
  const Similarity3 turn = Rigid3::from_roll_pitch_yaw({0.0, 0.0, 0.0}, 0.0, 0.0, 0.5);
  const Eigen::Vector3d centre(10.0, 0.0, 0.0);
  const Eigen::Vector3d to = centre + Eigen::Vector3d(3.0, 4.0, 0.0) - turn * centre;
  after.poses[NodeId{2}] = pose_of(2, 1, Rigid3(turn.rigid().quaternion(), to));
  after.poses[NodeId{3}] = pose_of(3, 3, Rigid3::from_roll_pitch_yaw({5.0, 0.0, 0.0}, 0, 0, 1.0));
  const AtlasDifference found = difference(before, after);
  ASSERT_EQ(found.moved.size(), 2U);
  EXPECT_EQ(found.moved[0].node, NodeId{2});
  EXPECT_FALSE(found.moved[0].frame_changed);
  EXPECT_NEAR(found.moved[0].shift, 5.0, 1e-9);
  EXPECT_NEAR(found.moved[0].turn_rad, 0.5, 1e-9);
  EXPECT_EQ(found.moved[1].node, NodeId{3});
  EXPECT_TRUE(found.moved[1].frame_changed);
  EXPECT_EQ(found.moved[1].shift, 0.0);
  EXPECT_EQ(found.moved[1].turn_rad, 0.0);
}

TEST(AtlasDifference, WhatIsNoLongerThereHasNotMoved) {
  AtlasState before = with_nodes({1});
  AtlasState after;
  before.poses[NodeId{1}] = pose_of(1, 1);
  after.poses[NodeId{1}] = pose_of(1, 1, Rigid3::from_roll_pitch_yaw({5.0, 0.0, 0.0}, 0, 0, 1.0));
  EXPECT_TRUE(difference(before, after).moved.empty());
}

TEST(AtlasDifference, ALinkThatIsNotDecidedIsNotContradicted) {
  AtlasState before;
  AtlasState after;
  for (std::uint64_t id = 1; id <= 5; ++id) after.links[LinkId{id}] = {};
  before.links = after.links;
  before.agrees = {{LinkId{1}, true}, {LinkId{2}, false}, {LinkId{5}, false}};
  after.agrees = {{LinkId{1}, false}, {LinkId{2}, true}, {LinkId{3}, false}};
  const AtlasDifference found = difference(before, after);
  EXPECT_EQ(found.now_contradicted, (std::vector{LinkId{1}, LinkId{3}}));
  EXPECT_EQ(found.no_longer_contradicted, (std::vector{LinkId{2}, LinkId{5}}));
}

}  // namespace
}  // namespace cairn
