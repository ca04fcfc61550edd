// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/atlas/detail/change_log.hpp"

#include <set>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/core/error.hpp"

#include "support/atlas_state.hpp"
#include "support/refusal.hpp"

namespace cairn {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using testing::link_of;
using testing::node_of;
using testing::pose_of;

TEST(RowValues, KeepTheLastValueOfEachObjectByKind) {
  RowValues values;
  EXPECT_TRUE(values.apply({kNode, 1, 10}));
  EXPECT_TRUE(values.apply({kLink, 1, 20}));
  EXPECT_TRUE(values.apply({kPose, 1, 30}));
  EXPECT_TRUE(values.apply({kAgrees, 1, 0}));
  EXPECT_TRUE(values.apply({kNode, 2, 11}));
  EXPECT_TRUE(values.apply({kNode, 1, 12}));
  EXPECT_TRUE(values.apply({kNode, 2, {}}));
  EXPECT_FALSE(values.apply({0, 1, 1}));
  EXPECT_FALSE(values.apply({5, 1, 1}));
  using Values = std::map<std::uint64_t, std::uint64_t>;
  EXPECT_EQ(values.nodes, (Values{{1, 12}}));
  EXPECT_EQ(values.links, (Values{{1, 20}}));
  EXPECT_EQ(values.poses, (Values{{1, 30}}));
  EXPECT_EQ(values.agrees, (Values{{1, 0}}));
}

TEST(CommitDigest, ChangesWithEveryField) {
  const AtlasCommit commit{CommitId{3}, 1000, "ann", "host", "add", "text", {}, CommitId{2}};
  const std::vector<RowChange> changes = {{kNode, 7, 8}};
  std::set<std::string> digests = {commit_digest(commit, changes)};
  const auto with = [&](auto change) {
    AtlasCommit other = commit;
    change(other);
    digests.insert(commit_digest(other, changes));
  };
  with([](AtlasCommit& c) { c.id = CommitId{4}; });
  with([](AtlasCommit& c) { c.time_ms = 1001; });
  with([](AtlasCommit& c) { c.author = "bob"; });
  with([](AtlasCommit& c) { c.host = "guest"; });
  with([](AtlasCommit& c) { c.verb = "link"; });
  with([](AtlasCommit& c) { c.text = "other"; });
  with([](AtlasCommit& c) { c.undoes = CommitId{1}; });
  with([](AtlasCommit& c) { c.undoes = CommitId{0}; });
  with([](AtlasCommit& c) { c.run = CommitId{3}; });
  // The same letters in other fields.
  with([](AtlasCommit& c) { c.author = "annhost", c.host = ""; });
  for (const RowChange& change :
       {RowChange{kLink, 7, 8}, {kNode, 9, 8}, {kNode, 7, 9}, {kNode, 7, 0}, {kNode, 7, {}}}) {
    digests.insert(commit_digest(commit, std::vector{change}));
  }
  digests.insert(commit_digest(commit, {}));
  EXPECT_EQ(digests.size(), 17U);
  EXPECT_EQ(commit_digest(commit, changes), commit_digest(commit, changes));
}

// Two maps, a link and the poses of both.
AtlasState sound() {
  AtlasState state;
  for (std::uint64_t i : {1U, 2U}) {
    state.nodes[NodeId{i}] = node_of(i, "map " + std::to_string(i));
    state.poses[NodeId{i}] = pose_of(i, 1);
  }
  state.links[LinkId{1}] = link_of(1, 1, 2);
  state.agrees[LinkId{1}] = true;
  return state;
}

TEST(CheckState, RefusesByNameWhatIsNotWhole) {
  EXPECT_NO_THROW(check_state(sound(), "town", ErrorKind::kMisuse));
  const auto expect_refused = [](auto change, const std::string& reason) {
    AtlasState state = sound();
    change(state);
    for (const ErrorKind kind : {ErrorKind::kMisuse, ErrorKind::kInput}) {
      EXPECT_THAT(testing::message_of(kind, [&] { check_state(state, "town", kind); }),
                  AllOf(HasSubstr("town"), HasSubstr(reason)));
    }
  };
  expect_refused([](AtlasState& s) { s.nodes.at(NodeId{2}).name = ""; }, "map 2 has no name");
  expect_refused([](AtlasState& s) { s.nodes.at(NodeId{2}).name = "map 1"; },
                 "two maps called 'map 1'");
  expect_refused([](AtlasState& s) { s.links.at(LinkId{1}).source = NodeId{1}; },
                 "a map with itself");
  expect_refused([](AtlasState& s) { s.links.at(LinkId{1}).source = NodeId{3}; },
                 "link 1 is of map 3");
  expect_refused([](AtlasState& s) { s.links.at(LinkId{1}).target = NodeId{4}; },
                 "link 1 is of map 4");
  expect_refused([](AtlasState& s) { s.poses.at(NodeId{2}).frame = NodeId{3}; }, "map 2");
  expect_refused([](AtlasState& s) { s.poses[NodeId{5}] = pose_of(5, 1); }, "map 5");
  expect_refused([](AtlasState& s) { s.poses.erase(NodeId{1}); },
                 "the pose of map 2 is in the frame of map 1, which has no pose in it");
  expect_refused([](AtlasState& s) { s.poses.at(NodeId{1}).frame = NodeId{2}; },
                 "which has no pose in it");
  expect_refused([](AtlasState& s) { s.agrees[LinkId{2}] = true; }, "agreement");
}

TEST(CheckAgreements, RefusesToTakeThePosesFromALinkThatHadThem) {
  const auto expect_refused = [](auto change) {
    AtlasState after = sound();
    change(after);
    EXPECT_THAT(
        testing::message_of(ErrorKind::kMisuse, [&] { check_agreements(sound(), after, "town"); }),
        HasSubstr("link 1"));
    // It was so before.
    EXPECT_NO_THROW(check_agreements(after, after, "town"));
  };
  EXPECT_NO_THROW(check_agreements(sound(), sound(), "town"));
  expect_refused([](AtlasState& s) { s.poses.erase(NodeId{1}); });
  expect_refused([](AtlasState& s) { s.poses.erase(NodeId{2}); });
  expect_refused([](AtlasState& s) { s.poses.at(NodeId{2}).frame = NodeId{2}; });
  // A link between two frames contradicts what keeps them apart.
  AtlasState apart = sound();
  apart.poses.at(NodeId{2}).frame = NodeId{2};
  apart.agrees.at(LinkId{1}) = false;
  EXPECT_NO_THROW(check_agreements(sound(), apart, "town"));
}

TEST(ApplyChanges, ReplacesAndRemovesEachKind) {
  AtlasState state = sound();
  AtlasChanges changes;
  changes.nodes = {node_of(2, "renamed"), node_of(3, "map 3")};
  changes.links = {link_of(2, 1, 3)};
  changes.poses = {pose_of(2, 3)};
  changes.agrees = {{LinkId{2}, false}};
  changes.removed_nodes = {NodeId{1}};
  changes.removed_links = {LinkId{1}};
  changes.removed_poses = {NodeId{1}};
  changes.removed_agrees = {LinkId{1}};
  apply(changes, state);
  EXPECT_EQ(state.nodes.size(), 2U);
  EXPECT_EQ(state.nodes.at(NodeId{2}).name, "renamed");
  EXPECT_EQ(state.nodes.at(NodeId{3}).name, "map 3");
  EXPECT_EQ(state.links.size(), 1U);
  EXPECT_EQ(state.links.at(LinkId{2}).source, NodeId{3});
  EXPECT_EQ(state.poses.size(), 1U);
  EXPECT_EQ(state.poses.at(NodeId{2}).frame, NodeId{3});
  EXPECT_EQ(state.agrees, (std::map<LinkId, bool>{{LinkId{2}, false}}));
}

TEST(HasPosesOf, IsFalseForALinkThatIsNotThere) {
  EXPECT_FALSE(has_poses_of(sound(), LinkId{99}, false));
}

// Undoing restores what an earlier commit removed: removal comes first.
TEST(ApplyChanges, WhatIsBothRemovedAndSetIsThere) {
  AtlasState state = sound();
  AtlasChanges changes;
  changes.removed_nodes = {NodeId{2}};
  changes.nodes = {node_of(2, "again")};
  apply(changes, state);
  EXPECT_EQ(state.nodes.at(NodeId{2}).name, "again");
}

}  // namespace
}  // namespace cairn
