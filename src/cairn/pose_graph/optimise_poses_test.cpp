// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/pose_graph/optimise_poses.hpp"

#include <cmath>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/core/random.hpp"
#include "cairn/geometry/covariance.hpp"

#include "support/refusal.hpp"

namespace cairn {
namespace {

using ::testing::HasSubstr;

constexpr double kShift = 0.002;  // deviations of a link's error
constexpr double kTurn = 0.001;

Rigid3 random_pose(Random& random, double length) {
  const Eigen::Vector3d turn(random.normal(), random.normal(), random.normal());
  return {rotation_exp(turn),
          length * Eigen::Vector3d(random.normal(), random.normal(), random.normal())};
}

// Nodes in one world, and links between them with errors as their covariances say.
struct World {
  explicit World(std::size_t nodes, std::uint64_t seed, bool scales = false) : random(seed) {
    for (std::size_t i = 0; i < nodes; ++i) {
      const double scale = scales && i > 0 ? std::exp(0.5 * random.normal()) : 1.0;
      truth.emplace_back(scale, i == 0 ? Rigid3() : random_pose(random, 1.0));
      graph.nodes.push_back({NodeId{10 * i}, {}, {}, {}});
    }
    extents.resize(nodes);
  }
  void link(std::size_t target, std::size_t source, bool with_scale = false) {
    const Similarity3 right = truth[target].inverse() * truth[source];
    Vector6d error;
    for (int i = 0; i < 6; ++i) error[i] = (i < 3 ? shift : turn) * random.normal();
    Link link;
    link.target = NodeId{10 * target};
    link.source = NodeId{10 * source};
    const double scale = right.scale() * (with_scale ? std::exp(turn * random.normal()) : 1.0);
    link.target_from_source = Similarity3(scale, right.rigid().perturbed(error));
    Vector7d variances;
    variances << Eigen::Vector3d::Constant(shift * shift), Eigen::Vector4d::Constant(turn * turn);
    const Matrix7d covariance = variances.asDiagonal();
    if (with_scale) link.covariance_with_scale = covariance;
    link.covariance = Matrix6d(covariance.topLeftCorner<6, 6>());
    graph.links.push_back(link);
  }
  void wrong_link(std::size_t target, std::size_t source) {
    link(target, source);
    graph.links.back().target_from_source = random_pose(random, 1.0);
  }
  double error(const OptimisedPoses& poses, std::size_t node) const {
    const Rigid3& pose = poses.world_from_node[node].value().rigid();
    return pose.difference_to(truth[node].rigid()).norm();
  }

  Random random;
  double shift = kShift;
  double turn = kTurn;
  std::vector<Similarity3> truth;
  PoseGraph graph;
  std::vector<NodeExtent> extents;
};

TEST(OptimisePoses, GivesALinkedNodeTheLinksPoseAndCovariance) {
  World world(2, 1);
  world.link(0, 1);
  const OptimisedPoses poses = optimise_poses(world.graph, world.extents);
  const Rigid3 expected = world.graph.links[0].target_from_source->rigid();
  EXPECT_LT(poses.world_from_node[1]->rigid().difference_to(expected).norm(), 1e-9);
  EXPECT_EQ(poses.world_from_node[0]->scale(), 1.0);
  EXPECT_LT(
      (Matrix6d(poses.covariances[1].topLeftCorner<6, 6>()) - *world.graph.links[0].covariance)
          .norm(),
      1e-10);
  EXPECT_EQ(poses.tree, std::vector<std::size_t>{0});
  EXPECT_EQ(poses.agrees, std::vector<bool>{true});
}

TEST(OptimisePoses, TakesALinkThatRunsTheOtherWay) {
  World world(2, 2, true);
  world.link(1, 0, true);
  const OptimisedPoses poses = optimise_poses(world.graph, world.extents);
  const Similarity3 expected = world.graph.links[0].target_from_source->inverse();
  EXPECT_LT((poses.world_from_node[1]->matrix() - expected.matrix()).norm(), 1e-8);
  const Matrix7d covariance = inverse_covariance(*world.graph.links[0].target_from_source,
                                                 *world.graph.links[0].covariance_with_scale);
  EXPECT_LT((poses.covariances[1] - covariance).norm(), 1e-3 * covariance.norm());
}

TEST(OptimisePoses, StatesHowExactPosesAreThatManyLinksDetermine) {
  double sum = 0.0;
  int count = 0;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    World world(6, seed);
    for (std::size_t i = 0; i < 6; ++i) {
      for (std::size_t j = i + 1; j < 6; ++j) world.link(i, j);
    }
    const OptimisedPoses poses = optimise_poses(world.graph, world.extents);
    for (std::size_t i = 1; i < 6; ++i) {
      sum += normalised_squared_error(poses.world_from_node[i]->rigid(),
                                      Matrix6d(poses.covariances[i].topLeftCorner<6, 6>()),
                                      world.truth[i].rigid());
      ++count;
    }
  }
  EXPECT_NEAR(sum / count, 6.0, 1.2);
}

// Nodes and links in another order give the same poses, relative to each other, and covariances in the same frame.
TEST(OptimisePoses, TheOrderOfNodesAndLinksDoesNotMatter) {
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    World world(8, seed);
    Random random(seed);
    for (std::size_t i = 0; i < 8; ++i) {
      world.extents[i].radius = 1.0 + 0.1 * static_cast<double>(i * 3 % 8);
      for (std::size_t j = i + 1; j < 8; ++j) {
        if (random.chance(0.7)) world.link(i, j);
      }
    }
    PoseGraph turned = world.graph;
    std::vector<NodeExtent> extents = world.extents;
    // The first node stays, so that the frame does.
    std::reverse(turned.nodes.begin() + 1, turned.nodes.end());
    std::reverse(extents.begin() + 1, extents.end());
    std::reverse(turned.links.begin(), turned.links.end());
    const OptimisedPoses given = optimise_poses(world.graph, world.extents);
    const OptimisedPoses other = optimise_poses(turned, extents);
    // Of nodes of one extent, the first is worked on first; otherwise it is not.
    const OptimisedPoses alike =
        optimise_poses(world.graph, std::vector<NodeExtent>(8, world.extents[0]));
    for (std::size_t i = 0; i < 8; ++i) {
      EXPECT_LE((given.covariances[i] - alike.covariances[i]).norm(),
                1e-3 * alike.covariances[i].norm());
      const std::size_t k = i == 0 ? 0 : 8 - i;
      ASSERT_EQ(given.world_from_node[i].has_value(), other.world_from_node[k].has_value());
      if (!given.world_from_node[i]) continue;
      EXPECT_LT((given.world_from_node[i]->matrix() - other.world_from_node[k]->matrix()).norm(),
                1e-9);
      EXPECT_LE((given.covariances[i] - other.covariances[k]).norm(),
                1e-6 * given.covariances[i].norm());
    }
    std::reverse(turned.nodes.begin(), turned.nodes.end());
    std::reverse(extents.begin(), extents.end());
    const OptimisedPoses in_another_frame = optimise_poses(turned, extents);
    const std::size_t first = 1;  // of the input before, which is the first now
    ASSERT_TRUE(in_another_frame.world_from_node[0] && given.world_from_node[first]);
    for (std::size_t i = 1; i < 8; ++i) {
      const Similarity3 expected =
          given.world_from_node[first]->inverse() * *given.world_from_node[i];
      EXPECT_LT((expected.matrix() - in_another_frame.world_from_node[i - 1]->matrix()).norm(),
                1e-9);
    }
  }
}

TEST(OptimisePoses, KeepsNoWrongLinkWhereOthersSpeak) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    World world(10, seed);
    Random random(100 + seed);
    std::vector<bool> right;
    for (std::size_t i = 0; i < 10; ++i) {
      for (std::size_t j = i + 1; j < 10; ++j) {
        right.push_back(!random.chance(0.4));
        if (right.back()) {
          world.link(i, j);
        } else {
          world.wrong_link(i, j);
        }
      }
    }
    const OptimisedPoses poses = optimise_poses(world.graph, world.extents);
    // A node with one right link among wrong ones is left out: nobody can tell which it is.
    std::vector<int> rights(10, 0);
    for (std::size_t k = 0; k < right.size(); ++k) {
      for (const NodeId end : {world.graph.links[k].target, world.graph.links[k].source}) {
        rights[end.value / 10] += right[k] ? 1 : 0;
      }
    }
    std::vector<bool> expected = right;
    for (std::size_t i = 0; i < 10; ++i) {
      if (rights[i] >= 2) {
        ASSERT_TRUE(poses.world_from_node[i]) << seed << ": " << i;
        EXPECT_LT(world.error(poses, i), 0.01) << seed;
        continue;
      }
      EXPECT_FALSE(poses.world_from_node[i]) << seed << ": " << i;
      for (std::size_t k = 0; k < right.size(); ++k) {
        const Link& link = world.graph.links[k];
        if (link.target == NodeId{10 * i} || link.source == NodeId{10 * i}) expected[k] = false;
      }
    }
    EXPECT_EQ(poses.agrees, expected) << seed;
  }
}

// The wrong one bends the first poses; once it is removed, nothing is left of it.
TEST(OptimisePoses, AWrongLinkDoesNotChangeTheCovariances) {
  constexpr std::size_t kNodes = 5;
  const auto link = [](std::size_t target, std::size_t source, double aside) {
    Link one;
    one.target = NodeId{target};
    one.source = NodeId{source};
    const double ahead = static_cast<double>(source) - static_cast<double>(target);
    one.target_from_source = Rigid3(Eigen::Matrix3d::Identity(), {ahead, aside, 0.0});
    Vector6d variances;
    variances << Eigen::Vector3d::Constant(0.05 * 0.05), Eigen::Vector3d::Constant(0.03 * 0.03);
    one.covariance = Matrix6d(variances.asDiagonal());
    return one;
  };
  PoseGraph graph;
  for (std::size_t i = 0; i < kNodes; ++i) graph.nodes.push_back({NodeId{i}, {}, {}, {}});
  for (std::size_t i = 0; i < kNodes; ++i) {
    for (std::size_t j = i + 1; j < kNodes; ++j) {
      if (j - i + 1 < kNodes) graph.links.push_back(link(i, j, 0.0));
    }
  }
  const std::vector<NodeExtent> extents(kNodes);
  const OptimisedPoses right = optimise_poses(graph, extents);
  graph.links.push_back(link(0, kNodes - 1, 0.3));
  const OptimisedPoses poses = optimise_poses(graph, extents);
  ASSERT_FALSE(poses.agrees.back());
  for (std::size_t i = 1; i < kNodes; ++i) {
    EXPECT_LT((poses.covariances[i] - right.covariances[i]).norm(),
              1e-6 * right.covariances[i].norm())
        << i;
  }
}

// Around a loop of 40 m, odometry drifts by more than one link may be off.
TEST(OptimisePoses, ClosesALongLoopInSpiteOfItsDrift) {
  constexpr std::size_t kNodes = 80;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    World world(kNodes, seed);
    world.shift = 0.01;
    world.turn = 0.005;
    for (std::size_t i = 0; i < kNodes; ++i) {
      const double angle = 6.283185307179586 * static_cast<double>(i) / kNodes;
      world.truth[i] = Rigid3::from_roll_pitch_yaw(
          6.4 * Eigen::Vector3d(std::sin(angle), 1.0 - std::cos(angle), 0.0), 0.0, 0.0, angle);
    }
    for (std::size_t i = 0; i < kNodes; ++i) world.link(i, (i + 1) % kNodes);
    const OptimisedPoses poses = optimise_poses(world.graph, world.extents);
    EXPECT_THAT(poses.agrees, ::testing::Each(true)) << seed;
    for (std::size_t i = 0; i < kNodes; ++i) {
      ASSERT_TRUE(poses.world_from_node[i]) << seed << ": " << i;
      // Of a loop whose ends meet, no node is further off than half the way's drift.
      EXPECT_LT(world.error(poses, i), 1.0) << seed << ": " << i;
    }
  }
}

// The same loop with one wrong link from its last node: nothing says which link is right.
TEST(OptimisePoses, ClosesNoLoopByAWrongLink) {
  constexpr std::size_t kNodes = 20;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    World world(kNodes, seed);
    for (std::size_t i = 0; i + 1 < kNodes; ++i) world.link(i, i + 1);
    world.wrong_link(0, kNodes - 1);
    const OptimisedPoses poses = optimise_poses(world.graph, world.extents);
    EXPECT_FALSE(poses.agrees.back()) << seed;
  }
}

TEST(OptimisePoses, LeavesOutWhatNothingConnects) {
  World world(5, 3);
  world.link(1, 2);
  world.link(2, 4);
  world.link(0, 3);
  const OptimisedPoses poses = optimise_poses(world.graph, world.extents);
  EXPECT_FALSE(poses.world_from_node[0]);
  EXPECT_FALSE(poses.world_from_node[3]);
  EXPECT_LT(poses.world_from_node[1]->matrix().isIdentity(1e-12) ? 0.0 : 1.0, 0.5);
  EXPECT_TRUE(poses.world_from_node[4]);
  EXPECT_EQ(poses.agrees, (std::vector<bool>{true, true, false}));
}

// Landmarks a kilometre from the origin are as certain as their link says, not as the origin is.
TEST(OptimisePoses, NoticesAContradictionHoweverFarTheLandmarksAreFromTheOrigin) {
  for (const double away : {0.0, 100.0, 1000.0}) {
    const Eigen::Vector3d centre(away, 0.0, 0.0);
    Eigen::Matrix<double, 6, 6> of_origin = Eigen::Matrix<double, 6, 6>::Identity();
    of_origin.topRightCorner<3, 3>() = skew(centre);
    Vector6d variances;
    variances << Eigen::Vector3d::Constant(1e-4), Eigen::Vector3d::Constant(1e-6);
    const Matrix6d covariance = of_origin * variances.asDiagonal() * of_origin.transpose();
    PoseGraph graph;
    graph.nodes = {{NodeId{0}, {}, {}, {}}, {NodeId{1}, {}, {}, {}}};
    for (const double aside : {0.0, 2.0}) {
      Link link;
      link.target = NodeId{0};
      link.source = NodeId{1};
      link.target_from_source = Rigid3(Eigen::Matrix3d::Identity(), {0.0, aside, 0.0});
      link.covariance = covariance;
      graph.links.push_back(link);
    }
    const std::vector<NodeExtent> extents(2, NodeExtent{centre, 3.0});
    const OptimisedPoses poses = optimise_poses(graph, extents);
    EXPECT_THAT(poses.agrees, ::testing::ElementsAre(false, false)) << away;
    EXPECT_FALSE(poses.world_from_node[1]) << away;
  }
}

TEST(OptimisePoses, FindsScalesWhereLinksMeasureThem) {
  World world(4, 4, true);
  for (std::size_t i = 0; i < 4; ++i) {
    for (std::size_t j = i + 1; j < 4; ++j) world.link(i, j, true);
  }
  const OptimisedPoses poses = optimise_poses(world.graph, world.extents);
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_NEAR(poses.world_from_node[i]->scale() / world.truth[i].scale(), 1.0, 0.01);
    EXPECT_LT(world.error(poses, i), 0.05);
  }
}

TEST(OptimisePoses, RefusesExtentsThatAreNone) {
  World world(2, 5);
  world.extents[1].radius = 0.0;
  EXPECT_THAT(
      testing::refusal(ErrorKind::kMisuse, [&] { optimise_poses(world.graph, world.extents); }),
      HasSubstr("NodeExtent.radius: 0"));
  world.extents.pop_back();
  EXPECT_THAT(
      testing::refusal(ErrorKind::kMisuse, [&] { optimise_poses(world.graph, world.extents); }),
      HasSubstr("2, one a node"));
}

}  // namespace
}  // namespace cairn
