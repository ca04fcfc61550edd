// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/pose_graph/detail/pose_edges.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/core/random.hpp"
#include "cairn/pose_graph/detail/pose_least_squares.hpp"

#include "support/moved_poses.hpp"
#include "support/refusal.hpp"

namespace cairn::detail {
namespace {

using ::testing::HasSubstr;
using testing::moved_along;

Similarity3 pose(Random& random) {
  const Rigid3 rigid = testing::random_pose(random);
  return {random.uniform(0.5, 2.0), rigid};
}

TEST(Disagreement, IsHowFarANodesLandmarksAreApartInRadii) {
  const NodeExtent extent{{1.0, 2.0, 3.0}, 4.0};
  const Similarity3 a(2.0, Rigid3::from_roll_pitch_yaw({5.0, 6.0, 7.0}, 0.1, 0.2, 0.3));
  EXPECT_EQ(disagreement(a, a, extent), 0.0);
  const Eigen::Vector3d aside = a.translation() + Eigen::Vector3d(0.0, 0.8, 0.0);
  EXPECT_NEAR(disagreement(a, {2.0, Rigid3(a.rigid().quaternion(), aside)}, extent), 0.1, 1e-12);
  // Turned, or grown, about the centre.
  const Eigen::Quaterniond turned = a.rigid().quaternion() * rotation_exp({0.0, 0.2, 0.0});
  EXPECT_NEAR(
      disagreement(a, {2.0, Rigid3(turned, a * extent.centre - 2.0 * (turned * extent.centre))},
                   extent),
      0.2, 1e-12);
  const Eigen::Vector3d centre = a.linear() * extent.centre;
  const Similarity3 grown(
      2.0 * std::exp(0.3),
      Rigid3(a.rigid().quaternion(), a.translation() + centre - std::exp(0.3) * centre));
  EXPECT_NEAR(disagreement(a, grown, extent), 0.3, 1e-12);
  EXPECT_NEAR(disagreement(grown, a, extent), 0.3, 1e-12);
}

TEST(Disagreement, DoesNotDependOnTheFrameOfBothPoses) {
  Random random(1);
  for (int i = 0; i < 20; ++i) {
    const NodeExtent extent{pose(random).translation(), random.uniform(0.5, 3.0)};
    const Similarity3 a = pose(random);
    const Similarity3 b = pose(random);
    const Similarity3 frame = pose(random);
    EXPECT_NEAR(disagreement(frame * a, frame * b, extent), disagreement(a, b, extent), 1e-9);
  }
}

TEST(MeanSquareDisagreement, IsThatOfAMoveInAnyDirection) {
  Random random(2);
  for (int i = 0; i < 5; ++i) {
    const Similarity3 a = pose(random);
    const NodeExtent extent{{0.0, 0.0, 0.0}, random.uniform(0.5, 3.0)};
    Matrix7d sum = Matrix7d::Zero();
    double expected_sum = 0.0;
    for (int k = 0; k < 7; ++k) {
      constexpr double kBy = 1e-3;
      Matrix7d covariance = Matrix7d::Zero();
      covariance(k, k) = kBy * kBy * (1 + k);
      const double distance = disagreement(a, moved_along(a, k, kBy), extent);
      EXPECT_NEAR(mean_square_disagreement(covariance, a, extent), distance * distance * (1 + k),
                  1e-8 * kBy * kBy)
          << k;
      sum += covariance;
      expected_sum += distance * distance * (1 + k);
    }
    EXPECT_NEAR(mean_square_disagreement(sum, a, extent), expected_sum, 1e-13);
    const std::vector<NodeExtent> extents = {{Eigen::Vector3d::Zero(), 100.0}, extent};
    EXPECT_EQ(mean_square_disagreement({0, 0, 1, a, sum}, extents),
              mean_square_disagreement(sum, a, extent));
  }
}

// A turn about an origin far from the landmarks moves these much; the covariance says that they do not move.
TEST(MeanSquareDisagreement, DoesNotDependOnWhereTheNodesOriginIs) {
  const Similarity3 near(2.0, Rigid3::from_roll_pitch_yaw({5.0, 6.0, 7.0}, 0.1, 0.2, 0.3));
  const NodeExtent about_origin{Eigen::Vector3d::Zero(), 3.0};
  Vector7d variances;
  variances << 1e-4, 2e-4, 3e-4, 1e-6, 2e-6, 3e-6, 4e-6;
  const Matrix7d covariance = variances.asDiagonal();
  const double expected = mean_square_disagreement(covariance, near, about_origin);
  const Eigen::Vector3d centre(1000.0, -300.0, 50.0);
  const NodeExtent extent{centre, 3.0};
  const Eigen::Vector3d arm = near.linear() * centre;
  const Similarity3 far(2.0, Rigid3(near.rigid().quaternion(), near.translation() - arm));
  Eigen::Matrix<double, 7, 7> of_origin = Eigen::Matrix<double, 7, 7>::Identity();
  of_origin.block<3, 3>(0, 3) = skew(arm);
  of_origin.block<3, 1>(0, 6) = -arm;
  const Matrix7d carried = of_origin * covariance * of_origin.transpose();
  EXPECT_NEAR(mean_square_disagreement(carried, far, extent), expected, 1e-6 * expected);
  EXPECT_GT(mean_square_disagreement(covariance, far, extent), 1e3 * expected);
}

TEST(CanAgree, AllowsForTheUncertaintyOfTheEdgeAndOfThePoses) {
  Random random(3);
  const std::vector<NodeExtent> extents(2);
  const Similarity3 target = pose(random);
  PoseEdge edge{0, 0, 1, {1.0, pose(random).rigid()}, Matrix7d::Zero()};
  // In the edge's own frame, so far off along one axis.
  const auto agrees = [&](double off, double variance, double agreement) {
    return can_agree(edge, target, target * moved_along(edge.target_from_source, 1, off), variance,
                     extents, agreement);
  };
  EXPECT_TRUE(agrees(0.099, 0.0, 0.1));
  EXPECT_FALSE(agrees(0.101, 0.0, 0.1));
  EXPECT_TRUE(agrees(0.0, 0.0, 0.0));
  // Two deviations more agree, and four do not, of the edge, of the poses, and of both together.
  const auto within_deviations = [&](double deviation, double variance) {
    EXPECT_TRUE(agrees(0.1 + 2.0 * deviation, variance, 0.1));
    EXPECT_FALSE(agrees(0.1 + 4.0 * deviation, variance, 0.1));
  };
  within_deviations(0.03, 0.03 * 0.03);
  edge.covariance(1, 1) = 0.04 * 0.04;
  within_deviations(0.04, 0.0);
  within_deviations(0.05, 0.03 * 0.03);
}

// Against the tree of least variance, which takes the most certain edges that close no ring (Kruskal).
TEST(MostCertainTree, IsThatOfLeastVariance) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    Random random(seed);
    constexpr std::size_t kNodes = 12;
    const std::vector<NodeExtent> extents(kNodes);
    std::vector<PoseEdge> edges;
    for (std::size_t i = 0; i < 25; ++i) {
      const std::size_t target = random.index(kNodes);
      const std::size_t source = (target + 1 + random.index(kNodes - 1)) % kNodes;
      edges.push_back(
          {100 + i, target, source, {}, random.uniform(0.1, 1.0) * Matrix7d::Identity()});
    }
    std::vector<std::size_t> order(edges.size());
    std::iota(order.begin(), order.end(), 0U);
    std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
      return edges[a].covariance(0, 0) < edges[b].covariance(0, 0);
    });
    std::vector<std::size_t> part(kNodes);
    std::iota(part.begin(), part.end(), 0U);
    std::vector<std::size_t> chosen;
    for (const std::size_t i : order) {
      const std::size_t kept = part[edges[i].target];
      const std::size_t joined = part[edges[i].source];
      if (kept == joined) continue;
      std::replace(part.begin(), part.end(), joined, kept);
      chosen.push_back(i);
    }
    for (std::size_t root = 0; root < kNodes; ++root) {
      std::vector<std::size_t> expected;
      for (const std::size_t i : chosen) {
        if (part[edges[i].target] == part[root]) expected.push_back(edges[i].link);
      }
      std::vector<bool> reached(kNodes, false);
      reached[root] = true;
      const std::vector<std::size_t> tree = most_certain_tree(root, edges, extents);
      for (const std::size_t link : tree) {
        const PoseEdge& edge = edges[link - 100];
        EXPECT_NE(reached[edge.target], reached[edge.source]) << "each reaches one more node";
        reached[edge.target] = reached[edge.source] = true;
      }
      EXPECT_THAT(tree, ::testing::UnorderedElementsAreArray(expected)) << seed;
    }
  }
}

// Two nodes and a link between them.
PoseGraph two_nodes() {
  PoseGraph graph;
  graph.nodes = {{NodeId{7}, {}, {}, {}}, {NodeId{3}, {}, {}, {}}};
  graph.links.resize(1);
  graph.links[0].target = NodeId{3};
  graph.links[0].source = NodeId{7};
  graph.links[0].target_from_source = Similarity3();
  return graph;
}

TEST(PoseEdges, AreTheLinksThatHaveACovariance) {
  PoseGraph graph = two_nodes();
  const std::vector<NodeExtent> extents(2);
  EXPECT_TRUE(pose_edges(graph, extents).empty());
  graph.links.push_back(graph.links[0]);
  Random random(4);
  graph.links[1].target_from_source = pose(random);
  const Matrix7d covariance = 0.01 * Matrix7d::Identity();
  graph.links[1].covariance_with_scale = covariance;
  const std::vector<PoseEdge> edges = pose_edges(graph, extents);
  ASSERT_EQ(edges.size(), 1U);
  EXPECT_EQ(edges[0].link, 1U);
  EXPECT_EQ(edges[0].target, 1U);
  EXPECT_EQ(edges[0].source, 0U);
  EXPECT_EQ(edges[0].target_from_source.matrix(), graph.links[1].target_from_source->matrix());
  EXPECT_LT((edges[0].covariance - covariance).norm(), 1e-9 * covariance.norm());
}

TEST(PoseEdges, TakeALinkThatMeasuresNoScaleForOneOfTheSameScale) {
  PoseGraph without = two_nodes();
  PoseGraph with = without;
  Matrix6d covariance = 0.01 * Matrix6d::Identity();
  covariance(1, 4) = covariance(4, 1) = 0.002;
  without.links[0].covariance = covariance;
  Matrix7d with_scale = Matrix7d::Zero();
  with_scale.topLeftCorner<6, 6>() = covariance;
  with_scale(6, 6) = kSameScale * kSameScale;
  with.links[0].covariance_with_scale = with_scale;
  const std::vector<NodeExtent> extents(2);
  EXPECT_EQ(pose_edges(without, extents).at(0).covariance,
            pose_edges(with, extents).at(0).covariance);
}

TEST(PoseEdges, AreNeverExactAndAlikeInAnyUnitOfLength) {
  PoseGraph graph = two_nodes();
  graph.links[0].covariance_with_scale = Matrix7d(Matrix7d::Zero());
  const std::vector<NodeExtent> extents(2);
  const Matrix7d least = pose_edges(graph, extents).at(0).covariance;
  EXPECT_EQ(least, Matrix7d(least.diagonal().asDiagonal()));
  EXPECT_GT(least.diagonal().minCoeff(), 0.0);
  EXPECT_LT(least.diagonal().maxCoeff(), 1e-10);
  // The source's landmarks in another unit, in the source's frame and in the target's.
  graph.links[0].target_from_source = Similarity3(5.0, Rigid3());
  const std::vector<NodeExtent> scaled = {{Eigen::Vector3d::Zero(), 1000.0}, {}};
  const Matrix7d found = pose_edges(graph, scaled).at(0).covariance;
  Vector7d units;
  units << Eigen::Vector3d::Constant(5000.0), Eigen::Vector4d::Ones();
  const Matrix7d expected = units.asDiagonal() * least * units.asDiagonal();
  EXPECT_LT((found - expected).norm(), 1e-12 * expected.norm());
  EXPECT_LT(Matrix4d((found - expected).bottomRightCorner<4, 4>()).norm(), 1e-24);
}

TEST(PoseEdges, RefuseRadiiThatAreNone) {
  const PoseGraph graph = two_nodes();
  for (const double radius : {0.0, -1.0, std::numeric_limits<double>::infinity(),
                              std::numeric_limits<double>::quiet_NaN()}) {
    const std::vector<NodeExtent> extents = {{}, {Eigen::Vector3d::Zero(), radius}};
    EXPECT_THAT(testing::refusal(ErrorKind::kMisuse, [&] { pose_edges(graph, extents); }),
                HasSubstr("NodeExtent.radius"));
  }
}

TEST(SessionNumbers, AreEqualForNodesOfOneSession) {
  PoseGraph graph;
  std::uint64_t id = 0;
  for (const char* session : {"", "a", "", "b", "a"}) {
    graph.nodes.push_back({NodeId{id++}, {}, session, {}});
  }
  const std::vector<std::size_t> numbers = session_numbers(graph);
  ASSERT_EQ(numbers.size(), 5U);
  for (std::size_t i = 0; i < 5; ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      EXPECT_EQ(numbers[i] == numbers[j], i == 4 && j == 1) << i << ", " << j;
    }
  }
}

}  // namespace
}  // namespace cairn::detail
