// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/pose_graph/detail/grown_poses.hpp"

#include <vector>

#include <gtest/gtest.h>

#include "cairn/core/random.hpp"

namespace cairn::detail {
namespace {

Similarity3 pose(Random& random, double length) {
  return Rigid3::from_roll_pitch_yaw(
      {random.uniform(0, length), random.uniform(0, length), random.uniform(0, length)},
      random.uniform(-3, 3), random.uniform(-1, 1), random.uniform(-3, 3));
}

struct Floor {
  Floor(std::size_t nodes, std::uint64_t seed) : random(seed), extents(nodes) {
    for (std::size_t i = 0; i < nodes; ++i) {
      truth.push_back(pose(random, 5.0));
      runs.push_back(i);
    }
  }
  void edge(std::size_t target, std::size_t source, const Similarity3& target_from_source) {
    edges.push_back(
        {edges.size(), target, source, target_from_source, 1e-6 * Matrix7d::Identity()});
  }
  void right(std::size_t target, std::size_t source) {
    edge(target, source, truth[target].inverse() * truth[source]);
  }
  void wrong(std::size_t target, std::size_t source) { edge(target, source, pose(random, 1.0)); }
  std::vector<PoseGroup> groups(double agreement = 0.1) const {
    return grow_groups(edges, extents, runs, agreement, [](PoseGroup&) {});
  }
  // Of a group's poses against the truth.
  double error(const PoseGroup& group) const {
    double most = 0.0;
    for (std::size_t i = 0; i < group.nodes.size(); ++i) {
      const Similarity3 first_from_node =
          group.group_from_node.front().inverse() * group.group_from_node[i];
      const Similarity3 expected = truth[group.nodes.front()].inverse() * truth[group.nodes[i]];
      most = std::max(most, disagreement(first_from_node, expected, extents[0]));
    }
    return most;
  }

  Random random;
  std::vector<Similarity3> truth;
  std::vector<NodeExtent> extents;
  std::vector<std::size_t> runs;
  std::vector<PoseEdge> edges;
};

TEST(GrowGroups, PlacesEveryNodeOfATree) {
  Floor floor(7, 1);
  for (std::size_t i = 1; i < 7; ++i) {
    if (i % 2 == 0) {
      floor.right(i / 2, i);
    } else {
      floor.right(i, i / 2);
    }
  }
  const auto groups = floor.groups();
  ASSERT_EQ(groups.size(), 1U);
  EXPECT_EQ(groups[0].nodes.size(), 7U);
  EXPECT_LT(floor.error(groups[0]), 1e-9);
}

TEST(GrowGroups, IsNotMisledByManyWrongEdges) {
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    Floor floor(30, seed);
    for (std::size_t i = 0; i < 30; ++i) {
      for (const std::size_t step : {1, 2, 3}) floor.right(i, (i + step) % 30);
    }
    for (int i = 0; i < 210; ++i) {  // seven of ten
      const std::size_t target = floor.random.index(30);
      floor.wrong(target, (target + 1 + floor.random.index(29)) % 30);
    }
    const auto groups = floor.groups();
    EXPECT_EQ(groups[0].nodes.size(), 30U) << seed;
    EXPECT_LT(floor.error(groups[0]), 1e-9) << seed;
  }
}

TEST(GrowGroups, BelievesTheMoreOfTwoGroupsOfEdgesEachOfWhichAgrees) {
  // Two robots of ten maps; between them six edges tell one offset, and five another.
  Floor floor(20, 3);
  for (std::size_t i = 0; i < 20; ++i) {
    if (i != 9 && i != 19) floor.right(i, i + 1);
  }
  for (std::size_t i = 0; i < 20; ++i) floor.runs[i] = i / 10;
  const Similarity3 off = pose(floor.random, 5.0);
  for (std::size_t i = 0; i < 6; ++i) floor.right(i, 10 + i);
  for (std::size_t i = 0; i < 5; ++i) {
    floor.edge(i, 19 - i, floor.truth[i].inverse() * off * floor.truth[19 - i]);
  }
  const auto groups = floor.groups();
  EXPECT_EQ(groups.size(), 1U);
  EXPECT_LT(floor.error(groups[0]), 1e-9);
}

TEST(GrowGroups, AThirdGroupDecidesBetweenTwoEdges) {
  Floor floor(3, 4);
  floor.wrong(0, 1);
  floor.right(0, 1);
  floor.right(1, 2);
  floor.right(2, 0);
  const auto groups = floor.groups();
  EXPECT_EQ(groups.size(), 1U);
  EXPECT_LT(floor.error(groups[0]), 1e-9);
}

TEST(GrowGroups, StayApartWhereOneWordStandsAgainstAnother) {
  Floor floor(4, 5);
  floor.right(0, 1);
  floor.wrong(1, 0);
  floor.right(2, 3);
  const auto groups = floor.groups();
  ASSERT_EQ(groups.size(), 3U);
  EXPECT_EQ(groups[0].nodes, (std::vector<std::size_t>{2, 3}));
}

TEST(GrowGroups, LargestFirstThenTheOneWithTheLowestNode) {
  Floor floor(6, 6);
  floor.right(4, 5);
  floor.right(1, 3);
  const auto groups = floor.groups();
  ASSERT_EQ(groups.size(), 4U);
  EXPECT_EQ(groups[0].nodes, (std::vector<std::size_t>{1, 3}));
  EXPECT_EQ(groups[1].nodes, (std::vector<std::size_t>{4, 5}));
  EXPECT_EQ(groups[2].nodes, (std::vector<std::size_t>{0}));
}

}  // namespace
}  // namespace cairn::detail
