// SPDX-License-Identifier: BSD-3-Clause
#include <cmath>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "cairn/atlas/queries.hpp"

#include "support/atlas_state.hpp"

namespace cairn {
namespace {

// Maps 1 to 4 without data; links are added by tests.
class RouteTest : public ::testing::Test {
 protected:
  RouteTest() {
    for (std::uint64_t i = 1; i <= 4; ++i) {
      state_.nodes[NodeId{i}] = testing::node_of(i, std::to_string(i));
    }
  }

  Link& link(std::uint64_t target, std::uint64_t source, const Similarity3& pose = {}) {
    const LinkId id{state_.links.size() + 1};
    Link& made = state_.links[id] = testing::link_of(id.value, target, source);
    made.verdict = Verdict::kAligned;
    made.target_from_source = pose;
    return made;
  }

  // The same standard deviation of all that a covariance is of.
  static Matrix6d covariance(double shift, double turn) {
    Matrix6d result = Matrix6d::Zero();
    for (int i = 0; i < 3; ++i) result(i, i) = shift * shift;
    for (int i = 3; i < 6; ++i) result(i, i) = turn * turn;
    return result;
  }

  std::vector<NodeId> nodes(std::uint64_t target, std::uint64_t source) const {
    return find_route(state_, NodeId{target}, NodeId{source}).value().nodes;
  }

  AtlasState state_;
  const std::vector<NodeId> direct_ = {NodeId{1}, NodeId{3}};
  const std::vector<NodeId> by_two_ = {NodeId{1}, NodeId{2}, NodeId{3}};
};

TEST_F(RouteTest, IsThatOfTheLeastVariance) {
  link(1, 3).covariance = covariance(0.03, 0.0);
  link(1, 2).covariance = covariance(0.02, 0.0);
  link(2, 3).covariance = covariance(0.02, 0.0);
  EXPECT_EQ(nodes(1, 3), by_two_);
  EXPECT_EQ(nodes(3, 1), (std::vector{NodeId{3}, NodeId{2}, NodeId{1}}));
  state_.links.at(LinkId{2}).covariance = covariance(0.025, 0.0);
  EXPECT_EQ(nodes(1, 3), direct_);
}

// The tolerance of a covariance lets small negative numbers pass, which a small radius makes large.
TEST_F(RouteTest, EndsWithCovariancesThatAreNotPositive) {
  for (const auto& [shift, radius] : {std::pair(-5e-7, 1e-6), std::pair(-1.0, 1e-200)}) {
    for (auto& [id, node] : state_.nodes) node.extent.radius = radius;
    state_.links.clear();
    for (const auto& [target, source] : {std::pair(1, 2), std::pair(2, 3)}) {
      Matrix6d narrow = covariance(0.0, 0.9);
      narrow.topLeftCorner<3, 3>() = shift * Eigen::Matrix3d::Identity();
      link(static_cast<std::uint64_t>(target), static_cast<std::uint64_t>(source)).covariance =
          narrow;
    }
    EXPECT_EQ(nodes(1, 3), by_two_);
  }
}

TEST_F(RouteTest, EachPartOfTheVarianceCounts) {
  for (int part = 0; part < 7; ++part) {
    state_.links.clear();
    const auto with = [&](double variance) {
      Matrix7d all = 1e-6 * Matrix7d::Identity();
      all(part, part) = variance;
      return all;
    };
    link(1, 3).covariance_with_scale = with(4e-4);
    link(1, 2).covariance_with_scale = with(1.5e-4);
    link(2, 3).covariance_with_scale = with(1.5e-4);
    EXPECT_EQ(nodes(1, 3), by_two_) << part;
    state_.links.at(LinkId{1}).covariance_with_scale = with(2e-4);
    EXPECT_EQ(nodes(1, 3), direct_) << part;
  }
}

// A shift counts as a share of the source's size, in the target's unit.
TEST_F(RouteTest, ShiftsAreSharesOfTheMapThatIsMoved) {
  link(1, 3).covariance = covariance(0.1, 0.0);
  link(1, 2).covariance = covariance(0.0, 0.03);
  link(2, 3).covariance = covariance(0.0, 0.03);
  EXPECT_EQ(nodes(1, 3), by_two_);
  state_.nodes.at(NodeId{3}).extent.radius = 5.0;  // the shift is a fiftieth of it
  EXPECT_EQ(nodes(1, 3), direct_);
  state_.links.at(LinkId{1}).target_from_source = Similarity3(0.2, Rigid3());
  EXPECT_EQ(nodes(1, 3), by_two_);
}

TEST_F(RouteTest, ALinkWithoutCovarianceIsTheLastResort) {
  link(1, 3);
  link(1, 2).covariance = covariance(1.0, 3.0);
  link(2, 3).covariance = covariance(1.0, 3.0);
  EXPECT_EQ(nodes(1, 3), by_two_);
  state_.links.erase(LinkId{3});
  const auto route = find_route(state_, NodeId{1}, NodeId{3});
  ASSERT_TRUE(route);
  EXPECT_EQ(route->nodes, direct_);
  EXPECT_FALSE(route->covariance);
}

TEST_F(RouteTest, OneLinkWithoutCovarianceLeavesTheWholeWithout) {
  link(1, 2).covariance = covariance(0.01, 0.01);
  link(2, 3);
  link(3, 4).covariance = covariance(0.01, 0.01);
  EXPECT_FALSE(find_route(state_, NodeId{1}, NodeId{4}).value().covariance);
  EXPECT_TRUE(find_route(state_, NodeId{3}, NodeId{4}).value().covariance);
}

TEST_F(RouteTest, OfExactLinksItTakesTheFewest) {
  link(1, 2).covariance = Matrix6d::Zero();
  link(2, 3).covariance = Matrix6d::Zero();
  link(1, 3).covariance = Matrix6d::Zero();
  EXPECT_EQ(nodes(1, 3), direct_);
}

TEST_F(RouteTest, TakesNoLinkThatIsRejectedOrContradicted) {
  link(1, 3).covariance = covariance(0.001, 0.001);
  link(1, 2).covariance = covariance(0.1, 0.1);
  link(2, 3).covariance = covariance(0.1, 0.1);
  state_.agrees = {{LinkId{1}, true}, {LinkId{2}, true}};
  EXPECT_EQ(nodes(1, 3), direct_);
  state_.agrees[LinkId{1}] = false;
  EXPECT_EQ(nodes(1, 3), by_two_);
  state_.agrees.clear();
  state_.links.at(LinkId{1}).verdict = Verdict::kAmbiguous;
  EXPECT_EQ(nodes(1, 3), by_two_);
  state_.links.at(LinkId{2}).verdict = Verdict::kRejected;
  EXPECT_FALSE(find_route(state_, NodeId{1}, NodeId{3}));
}

TEST_F(RouteTest, CovarianceOfSimilaritiesIsThatOfPerturbedLinks) {
  const Similarity3 first(2.0, Rigid3::from_roll_pitch_yaw({1.0, 2.0, -1.0}, 0.3, -0.2, 0.9));
  const Similarity3 second(0.7, Rigid3::from_roll_pitch_yaw({-2.0, 0.5, 1.5}, -0.4, 0.1, 0.2));
  Matrix7d of_first = Matrix7d::Zero();
  Matrix7d of_second = Matrix7d::Zero();
  for (int i = 0; i < 7; ++i) {
    of_first(i, i) = 1e-4 * (i + 1);
    of_second(i, i) = 1e-4 * (9 - i);
  }
  of_first(0, 6) = of_first(6, 0) = 5e-5;
  link(1, 2, first).covariance_with_scale = of_first;
  link(2, 3, second).covariance_with_scale = of_second;
  const auto route = find_route(state_, NodeId{1}, NodeId{3});
  ASSERT_TRUE(route && route->covariance);
  EXPECT_TRUE(route->target_from_source.matrix().isApprox((first * second).matrix(), 1e-12));

  // A left perturbation (δt, δφ, δ log s): t + δt, and rotation and scale from the left.
  const auto perturbed = [](const Similarity3& pose, const Eigen::Matrix<double, 7, 1>& delta) {
    return Similarity3(pose.scale() * std::exp(delta[6]), pose.rigid().perturbed(delta.head<6>()));
  };
  Eigen::Matrix<double, 7, 7> jacobians[2];
  const Similarity3 whole = first * second;
  constexpr double kStep = 1e-6;
  for (int axis = 0; axis < 7; ++axis) {
    Eigen::Matrix<double, 7, 1> delta = Eigen::Matrix<double, 7, 1>::Zero();
    delta[axis] = kStep;
    for (const bool is_first : {true, false}) {
      const Similarity3 moved =
          is_first ? perturbed(first, delta) * second : first * perturbed(second, delta);
      Eigen::Matrix<double, 7, 1> change;
      change.head<6>() = whole.rigid().difference_to(moved.rigid());
      change[6] = std::log(moved.scale() / whole.scale());
      jacobians[is_first ? 0 : 1].col(axis) = change / kStep;
    }
  }
  const Eigen::Matrix<double, 7, 7> expected = jacobians[0] * of_first * jacobians[0].transpose() +
                                               jacobians[1] * of_second * jacobians[1].transpose();
  const Eigen::Matrix<double, 7, 7> found = *route->covariance;
  EXPECT_LT((found - expected).norm(), 1e-4 * expected.norm()) << found << "\n\n" << expected;
}

TEST_F(RouteTest, GivesThePoseOfTheOptimisationIfBothAreInOneFrame) {
  link(1, 3).covariance = covariance(0.1, 0.1);
  const Similarity3 one = Rigid3::from_roll_pitch_yaw({1.0, 0.0, 0.0}, 0.0, 0.0, 0.3);
  const Similarity3 three = Rigid3::from_roll_pitch_yaw({2.0, 1.0, 0.0}, 0.1, 0.0, -0.3);
  const auto optimised = [&] { return find_route(state_, NodeId{1}, NodeId{3}).value().optimised; };
  EXPECT_FALSE(optimised());
  state_.poses[NodeId{1}] = testing::pose_of(1, 2, one);
  EXPECT_FALSE(optimised());
  state_.poses[NodeId{3}] = testing::pose_of(3, 2, three);
  ASSERT_TRUE(optimised());
  EXPECT_TRUE(optimised()->matrix().isApprox((one.inverse() * three).matrix(), 1e-12));
  state_.poses.at(NodeId{3}).frame = NodeId{3};
  EXPECT_FALSE(optimised());
  state_.poses.erase(NodeId{1});
  EXPECT_FALSE(optimised());
}

}  // namespace
}  // namespace cairn
