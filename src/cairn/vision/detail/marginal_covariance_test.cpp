// SPDX-License-Identifier: BSD-3-Clause
#include <Eigen/LU>
#include <gmock/gmock.h>

#include "cairn/core/error.hpp"
#include "cairn/vision/detail/covariances.hpp"

#include "support/landmark_graphs.hpp"
#include "support/refusal.hpp"

namespace cairn::detail {
namespace {

using testing::make_true_graph;
using testing::TrueGraph;

// Inverse of the full normal equations of poses (but the first) and landmarks, derivatives by
// finite differences.
class BruteForce {
 public:
  explicit BruteForce(const LandmarkGraph& graph)
      : graph_(graph),
        poses_(6 * (static_cast<Eigen::Index>(graph.keyframes().size()) - 1)),
        size_(poses_ + 3 * static_cast<Eigen::Index>(graph.landmarks().size())) {
    Eigen::MatrixXd information = Eigen::MatrixXd::Zero(size_, size_);
    for (std::size_t l = 0; l < graph.landmarks().size(); ++l) {
      const auto& observations = graph.landmarks()[l].observations;
      for (std::size_t i = 0; i < observations.size(); ++i) {
        const KeypointReference& at = observations[i];
        const Eigen::MatrixXd jacobian =
            derivative(at.keyframe, l, [&](const Rigid3& pose, const Eigen::Vector3d& x) {
              return point_residual(testing::kTestPinhole, graph.measurement(at),
                                    pose.inverse() * x)
                  .value;
            });
        information += information_share(i + 1) * jacobian.transpose() * jacobian;
      }
    }
    for (std::size_t l = 0; l < graph.landmarks().size(); ++l) {
      const Eigen::Index row = poses_ + 3 * static_cast<Eigen::Index>(l);
      information.block<3, 3>(row, row) += unknown_depth_information(graph, graph.landmarks()[l]);
    }
    covariance_ = information.inverse();
  }

  Eigen::MatrixXd keyframe(std::size_t k) const {
    const Eigen::Index row = 6 * (static_cast<Eigen::Index>(k) - 1);
    return covariance_.block(row, row, 6, 6);
  }

  // Of the landmark as its first keyframe sees it, along the world's axes.
  Eigen::MatrixXd landmark(std::size_t l) const {
    const std::uint32_t first = graph_.landmarks()[l].observations.front().keyframe;
    const Eigen::Matrix3d axes = graph_.keyframes()[first].world_from_camera.rotation();
    const Eigen::MatrixXd jacobian =
        derivative(first, l, [&](const Rigid3& pose, const Eigen::Vector3d& x) -> Eigen::Vector3d {
          return axes * (pose.inverse() * x);
        });
    return excess_of_residuals(graph_, graph_.landmarks()[l]) * jacobian * covariance_ *
           jacobian.transpose();
  }

 private:
  template <class Function>
  Eigen::MatrixXd derivative(std::uint32_t k, std::size_t l, const Function& function) const {
    constexpr double kStep = 1e-5;
    const Rigid3& pose = graph_.keyframes()[k].world_from_camera;
    const Eigen::Vector3d& x = graph_.landmarks()[l].position;
    Eigen::MatrixXd jacobian = Eigen::MatrixXd::Zero(3, size_);
    for (int i = 0; i < 6 && k > 0; ++i) {
      const Vector6d step = kStep * Vector6d::Unit(i);
      jacobian.col(6 * (static_cast<Eigen::Index>(k) - 1) + i) =
          (function(pose.perturbed(step), x) - function(pose.perturbed(-step), x)) / (2.0 * kStep);
    }
    for (int i = 0; i < 3; ++i) {
      const Eigen::Vector3d step = kStep * Eigen::Vector3d::Unit(i);
      jacobian.col(poses_ + 3 * static_cast<Eigen::Index>(l) + i) =
          (function(pose, x + step) - function(pose, x - step)) / (2.0 * kStep);
    }
    return jacobian;
  }

  const LandmarkGraph& graph_;
  Eigen::Index poses_;
  Eigen::Index size_;
  Eigen::MatrixXd covariance_;
};

void expect_inverse_of_normal_equations(const TrueGraph& made) {
  const BruteForce expected(made.graph);
  const MarginalCovariances found = marginal_covariances(made.graph);
  ASSERT_EQ(found.keyframes.size(), 4U);
  EXPECT_TRUE(found.keyframes[0].isZero()) << "fixed";
  for (std::size_t k = 1; k < 4; ++k) {
    EXPECT_LT((found.keyframes[k] - expected.keyframe(k)).norm(),
              1e-4 * expected.keyframe(k).norm());
  }
  ASSERT_EQ(found.landmarks.size(), made.graph.landmarks().size());
  for (std::size_t l = 0; l < found.landmarks.size(); ++l) {
    EXPECT_LT((found.landmarks[l] - expected.landmark(l)).norm(),
              1e-4 * expected.landmark(l).norm())
        << l << ", observed " << made.graph.landmarks()[l].observations.size() << " times";
  }
}

TEST(MarginalCovariances, AreTheInverseOfTheFullNormalEquations) {
  const TrueGraph made = make_true_graph(
      {.seed = 1, .keyframes = 4, .points = 30, .with_depth = 1.0, .seen_again = 0.6});
  std::size_t seen_once = 0;
  for (const auto& landmark : made.graph.landmarks()) {
    seen_once += landmark.observations.size() == 1 ? 1 : 0;
  }
  ASSERT_GT(seen_once, 0U);
  expect_inverse_of_normal_equations(made);
}

TEST(MarginalCovariances, KnowOfADepthThatIsNotBelievedItsOrderOfMagnitude) {
  TrueGraph made = make_true_graph(
      {.seed = 6, .keyframes = 4, .points = 30, .with_depth = 1.0, .seen_again = 0.6});
  for (const std::size_t l : {2, 9, 20}) {
    const KeypointReference unsure = made.graph.landmarks()[l].observations.front();
    made.graph.keyframes()[unsure.keyframe].depth_disagrees[unsure.keypoint] = true;
    ASSERT_FALSE(unknown_depth_information(made.graph, made.graph.landmarks()[l]).isZero());
  }
  expect_inverse_of_normal_equations(made);
}

TEST(InformationShare, FallsWithEveryObservationAndIsBounded) {
  EXPECT_EQ(information_share(1), 1.0);
  double sum = 1.0;
  for (std::size_t n = 2; n < 10000; ++n) {
    EXPECT_GT(information_share(n), 0.0);
    EXPECT_LT(information_share(n), information_share(n - 1));
    sum += information_share(n);
  }
  EXPECT_NEAR(sum, 1.0 / 0.3, 0.01) << "what any number of views is worth";
}

TEST(ExcessOfResiduals, IsOneForWhatFitsAndGrowsWithWhatDoesNot) {
  TrueGraph made = make_true_graph({.seed = 5, .keyframes = 4, .points = 20, .noise = 0.0});
  TrackedLandmark landmark = made.graph.landmarks()[0];
  ASSERT_GE(landmark.observations.size(), 2U);
  EXPECT_EQ(excess_of_residuals(made.graph, landmark), 1.0) << "no noise was added";
  landmark.position += Eigen::Vector3d(0.05, 0.0, 0.0);
  const double off = excess_of_residuals(made.graph, landmark);
  landmark.position += Eigen::Vector3d(0.05, 0.0, 0.0);
  EXPECT_GT(off, 10.0);
  EXPECT_GT(excess_of_residuals(made.graph, landmark), 2.0 * off);
}

TEST(MarginalCovariances, AreZeroForLandmarksThatAreGone) {
  TrueGraph made = make_true_graph({.seed = 2, .keyframes = 3, .points = 40});
  made.graph.remove({3});
  const MarginalCovariances found = marginal_covariances(made.graph);
  EXPECT_TRUE(found.landmarks[3].isZero());
  EXPECT_GT(found.landmarks[4].trace(), 0.0);
}

TEST(MarginalCovariances, AreFiniteForAKeyframeThatNothingTies) {
  TrueGraph made = make_true_graph({.seed = 3, .keyframes = 3, .points = 40});
  Keyframe alone;
  alone.features = testing::features_of({}, {});
  made.graph.add_keyframe(std::move(alone));
  const MarginalCovariances found = marginal_covariances(made.graph);
  EXPECT_TRUE(found.keyframes[3].allFinite());
  EXPECT_GT(found.keyframes[3].trace(), 1e3) << "as good as unknown";
  EXPECT_LT(found.keyframes[2].trace(), 1e-2);
}

TEST(MarginalCovariances, NothingInNothingOut) {
  const LandmarkGraph empty(testing::test_sensor());
  EXPECT_TRUE(marginal_covariances(empty).keyframes.empty());
  const TrueGraph one = make_true_graph({.seed = 4, .keyframes = 1, .points = 20});
  const MarginalCovariances found = marginal_covariances(one.graph);
  for (const Eigen::Matrix3d& covariance : found.landmarks) {
    EXPECT_TRUE(covariance.allFinite());
    EXPECT_GT(covariance.determinant(), 0.0);
  }
}

TEST(MarginalCovariances, TooManyKeyframesAreRefused) {
  LandmarkGraph graph(testing::test_sensor());
  for (std::size_t k = 0; k <= kMostDenseFrames; ++k) graph.add_keyframe(Keyframe());
  EXPECT_THAT(testing::message_of(ErrorKind::kMisuse, [&] { marginal_covariances(graph); }),
              ::testing::HasSubstr("cut the sequence into mini-maps"));
}

}  // namespace
}  // namespace cairn::detail
