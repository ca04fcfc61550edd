// SPDX-License-Identifier: BSD-3-Clause
#include <cmath>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/core/random.hpp"
#include "cairn/geometry/covariance.hpp"
#include "cairn/pose_graph/optimise_poses.hpp"

#include "support/refusal.hpp"

namespace cairn {
namespace {

using ::testing::HasSubstr;

constexpr double kLinkShift = 0.01;  // deviations of a link's error
constexpr double kLinkTurn = 0.005;

// Maps along a meandering drive over a floor, each linked with those nearby.
struct Drive {
  Drive(std::size_t maps, std::uint64_t seed, std::size_t row = 8) : random(seed) {
    for (std::size_t i = 0; i < maps; ++i) {
      const std::size_t line = i / row;
      const std::size_t along = line % 2 == 0 ? i % row : row - 1 - i % row;
      truth.push_back(
          Rigid3::from_roll_pitch_yaw({static_cast<double>(along), static_cast<double>(line), 0.0},
                                      0.0, 0.0, random.uniform(-3.0, 3.0)));
      graph.nodes.push_back({NodeId{i + 1}, {}, {}, {}});
      for (std::size_t k = 0; k < i; ++k) {
        if ((truth[i].translation() - truth[k].translation()).norm() < 1.1) link(k, i);
      }
    }
    extents.assign(maps, {Eigen::Vector3d::Zero(), 1.0});
  }
  void link(std::size_t target, std::size_t source) {
    Vector6d error;
    for (int i = 0; i < 6; ++i) error[i] = (i < 3 ? kLinkShift : kLinkTurn) * random.normal();
    link_at(target, source, (truth[target].inverse() * truth[source]).perturbed(error));
  }
  void wrong_link(std::size_t target, std::size_t source) {
    link_at(target, source,
            Rigid3::from_roll_pitch_yaw({random.uniform(-3.0, 3.0), random.uniform(-3.0, 3.0), 0.0},
                                        0.0, 0.0, random.uniform(-3.0, 3.0)));
  }
  void link_at(std::size_t target, std::size_t source, const Rigid3& target_from_source) {
    Vector6d variances;
    variances << Eigen::Vector3d::Constant(kLinkShift * kLinkShift),
        Eigen::Vector3d::Constant(kLinkTurn * kLinkTurn);
    graph.links.push_back({.target = NodeId{target + 1},
                           .source = NodeId{source + 1},
                           .probability = 0.999,
                           .target_from_source = Similarity3(target_from_source),
                           .covariance = Matrix6d(variances.asDiagonal())});
  }

  // The graph without the last maps and, of the others, without the last links.
  PoseGraph without(std::size_t maps, std::size_t links = 0) const {
    PoseGraph less = graph;
    less.nodes.resize(graph.nodes.size() - maps);
    less.links.resize(graph.links.size() - links);
    std::erase_if(less.links, [&](const Link& link) {
      return link.source.value > less.nodes.size() || link.target.value > less.nodes.size();
    });
    return less;
  }
  // Its poses, with an entry for each map and link of the whole graph.
  OptimisedPoses before(const PoseGraph& less) const {
    OptimisedPoses poses = optimise_poses(less, std::span(extents).first(less.nodes.size()));
    poses.world_from_node.resize(graph.nodes.size());
    poses.covariances.resize(graph.nodes.size(), Matrix7d::Zero());
    std::vector<bool> agrees;
    std::size_t next = 0;
    for (const Link& link : graph.links) {
      const bool is_there =
          next < less.links.size() && less.links[next].source == link.source &&
          less.links[next].target == link.target &&
          (less.links[next].target_from_source->matrix() == link.target_from_source->matrix());
      agrees.push_back(is_there && poses.agrees[next]);
      if (is_there) ++next;
    }
    poses.agrees = std::move(agrees);
    return poses;
  }
  OptimisedPoses updated(const OptimisedPoses& before) const {
    return update_poses(graph, extents, before);
  }
  OptimisedPoses anew() const { return optimise_poses(graph, extents); }

  Random random;
  std::vector<Rigid3> truth;
  PoseGraph graph;
  std::vector<NodeExtent> extents;
};

// By how many of its standard deviations a pose differs, at most.
double deviations(const OptimisedPoses& a, const OptimisedPoses& b) {
  double most = 0.0;
  for (std::size_t i = 0; i < a.world_from_node.size(); ++i) {
    if (!a.world_from_node[i] || !b.world_from_node[i]) {
      EXPECT_EQ(a.world_from_node[i].has_value(), b.world_from_node[i].has_value()) << i;
      continue;
    }
    const Vector6d error =
        a.world_from_node[i]->rigid().difference_to(b.world_from_node[i]->rigid());
    for (int k = 0; k < 6; ++k) {
      const double deviation = std::sqrt(b.covariances[i](k, k));
      if (deviation > 0.0) most = std::max(most, std::abs(error[k]) / deviation);
    }
  }
  return most;
}

// The law: with the same links, an update states what the full solution states.
void expect_same(const OptimisedPoses& updated, const OptimisedPoses& anew) {
  EXPECT_EQ(updated.agrees, anew.agrees);
  EXPECT_LT(deviations(updated, anew), 0.1);
  for (std::size_t i = 0; i < anew.covariances.size(); ++i) {
    for (int k = 0; k < 6; ++k) {
      EXPECT_NEAR(updated.covariances[i](k, k), anew.covariances[i](k, k),
                  0.2 * anew.covariances[i](k, k))
          << i << ", " << k;
    }
  }
}

TEST(UpdatePoses, PlacesANewMapAsIfAllWereOptimised) {
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    const Drive drive(60, seed);
    const OptimisedPoses before = drive.before(drive.without(1));
    const OptimisedPoses updated = drive.updated(before);
    const OptimisedPoses anew = drive.anew();
    expect_same(updated, anew);
    expect_same(drive.updated(drive.before(drive.without(3))), anew);
    EXPECT_EQ(updated.tree, anew.tree);
  }
}

TEST(UpdatePoses, StatesCovariancesThatTheErrorsHave) {
  double sum = 0.0;
  double count = 0.0;
  for (std::uint64_t seed = 1; seed <= 200; ++seed) {
    const Drive drive(14, seed, 4);
    const OptimisedPoses poses = drive.updated(drive.before(drive.without(3, 2)));
    for (std::size_t i = 1; i < drive.truth.size(); ++i) {
      ASSERT_TRUE(poses.world_from_node[i]) << seed;
      sum += normalised_squared_error(poses.world_from_node[i]->rigid(),
                                      Matrix6d(poses.covariances[i].topLeftCorner<6, 6>()),
                                      drive.truth.front().inverse() * drive.truth[i]);
      count += 1.0;
    }
  }
  EXPECT_NEAR(sum / count, 6.0, 1.2);
}

// 12 maps in a line drift by some standard deviations of a link; links from its end to its start correct all.
TEST(UpdatePoses, CorrectsTheWholeLoopThatNewLinksClose) {
  Drive drive(12, 7, 12);
  drive.link(0, 11);
  drive.link(1, 11);
  drive.link(0, 10);
  const OptimisedPoses before = drive.before(drive.without(0, 3));
  const OptimisedPoses updated = drive.updated(before);
  const OptimisedPoses anew = drive.anew();
  expect_same(updated, anew);
  EXPECT_TRUE(updated.agrees.back());
}

// A weak link is the only one with which the new map joins first; a strong one, at the end of a long chain, determines
// the chain, too.
TEST(UpdatePoses, StatesWhatAWeakLinkAndALongChainGive) {
  Drive drive(10, 13, 10);
  drive.graph.nodes.push_back(drive.graph.nodes.back());
  drive.graph.nodes.back().id = NodeId{11};
  drive.extents.push_back(drive.extents.back());
  const auto link = [&](std::size_t target, double sigma) {
    Link one = drive.graph.links.front();
    one.target = NodeId{target + 1};
    one.source = NodeId{11};
    one.target_from_source = Similarity3(drive.truth[target].inverse() * drive.truth[9]);
    one.covariance = Matrix6d(sigma * sigma * Matrix6d::Identity());
    drive.graph.links.push_back(one);
  };
  link(0, 0.05);
  link(9, 0.001);
  expect_same(drive.updated(drive.before(drive.without(1))), drive.anew());
}

TEST(UpdatePoses, KeepsNoWrongLinkThatOthersContradict) {
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    Drive drive(50, seed);
    const OptimisedPoses before = drive.before(drive.without(2));
    OptimisedPoses known = before;
    for (std::size_t k = 0; k < 4; ++k) {
      drive.wrong_link(drive.random.index(48), 48 + k % 2);
      known.agrees.push_back(false);
    }
    const OptimisedPoses updated = drive.updated(known);
    for (std::size_t i = 0; i < drive.graph.links.size(); ++i)
      EXPECT_EQ(updated.agrees[i], i + 4 < drive.graph.links.size()) << i;
    EXPECT_LT(deviations(updated, drive.anew()), 0.2);
  }
}

TEST(UpdatePoses, DoesNotReconsiderALinkThatWasContradicted) {
  Drive drive(50, 11);
  drive.wrong_link(3, 30);
  const OptimisedPoses before = drive.before(drive.graph);
  ASSERT_FALSE(before.agrees.back());
  const OptimisedPoses updated = drive.updated(before);
  EXPECT_EQ(updated.agrees, before.agrees);
  for (std::size_t i = 0; i < 50; ++i)
    EXPECT_EQ(updated.world_from_node[i]->matrix(), before.world_from_node[i]->matrix());
}

TEST(UpdatePoses, JoinsASessionThatWasApart) {
  Drive drive(40, 12);
  for (std::size_t i = 0; i < 40; ++i) drive.graph.nodes[i].session = i < 28 ? "first" : "second";
  // Without the links between them.
  PoseGraph less = drive.graph;
  std::erase_if(less.links, [](const Link& link) {
    return (link.target.value <= 28) != (link.source.value <= 28);
  });
  OptimisedPoses before = drive.before(less);
  ASSERT_TRUE(before.world_from_node[27]);
  ASSERT_FALSE(before.world_from_node[28]);
  const OptimisedPoses updated = drive.updated(before);
  EXPECT_LT(deviations(updated, drive.anew()), 0.3);
}

TEST(UpdatePoses, OptimisesAnewIfTheFrameChanges) {
  const Drive drive(12, 13);
  OptimisedPoses before = drive.before(drive.graph);
  // As if the first map were new.
  const Similarity3 second_from_world = before.world_from_node[1]->inverse();
  for (auto& pose : before.world_from_node) pose = second_from_world * *pose;
  before.world_from_node[0].reset();
  const OptimisedPoses updated = drive.updated(before);
  const OptimisedPoses anew = drive.anew();
  for (std::size_t i = 0; i < 12; ++i) {
    EXPECT_EQ(updated.world_from_node[i]->matrix(), anew.world_from_node[i]->matrix());
    EXPECT_EQ(updated.covariances[i], anew.covariances[i]);
  }
}

TEST(UpdatePoses, OptimisesAnewIfLinksThatWereUsedAreGone) {
  Drive drive(20, 14, 20);
  const OptimisedPoses whole = drive.before(drive.graph);
  // The line is cut after the twelfth map.
  OptimisedPoses before = whole;
  std::vector<bool> agrees;
  std::vector<Link> links;
  for (std::size_t i = 0; i < drive.graph.links.size(); ++i) {
    const Link& link = drive.graph.links[i];
    if (link.target.value <= 12 && link.source.value > 12) continue;
    links.push_back(link);
    agrees.push_back(whole.agrees[i]);
  }
  drive.graph.links = links;
  before.agrees = agrees;
  const OptimisedPoses updated = drive.updated(before);
  for (std::size_t i = 0; i < 20; ++i) EXPECT_EQ(updated.world_from_node[i].has_value(), i < 12);
}

TEST(UpdatePoses, RefusesAnIncompleteStart) {
  const Drive drive(5, 15);
  OptimisedPoses before = drive.before(drive.graph);
  before.agrees.pop_back();
  EXPECT_THAT(testing::message_of(ErrorKind::kMisuse, [&] { drive.updated(before); }),
              HasSubstr("one entry a node (5) and a link"));
}

}  // namespace
}  // namespace cairn
