// SPDX-License-Identifier: BSD-3-Clause
#include <optional>
#include <vector>

#include <Eigen/LU>
#include <gtest/gtest.h>

#include "cairn/vision/detail/covariances.hpp"

#include "support/landmark_graphs.hpp"

namespace cairn::detail {
namespace {

using testing::make_true_graph;
using testing::TrueGraph;

struct Derivatives {
  Eigen::Matrix3d by_point;
  Eigen::Matrix<double, 3, 6> by_pose;
};

// Of an observation's residuals, by finite differences.
Derivatives derivatives(const LandmarkGraph& graph, const KeypointReference& at,
                        const Eigen::Vector3d& point) {
  constexpr double kStep = 1e-5;
  const Rigid3& pose = graph.keyframes()[at.keyframe].world_from_camera;
  const auto residual = [&](const Rigid3& world_from_camera, const Eigen::Vector3d& x) {
    return point_residual(testing::kTestPinhole, graph.measurement(at),
                          world_from_camera.inverse() * x)
        .value;
  };
  Derivatives result;
  for (int i = 0; i < 3; ++i) {
    const Eigen::Vector3d step = kStep * Eigen::Vector3d::Unit(i);
    result.by_point.col(i) =
        (residual(pose, point + step) - residual(pose, point - step)) / (2.0 * kStep);
  }
  for (int i = 0; i < 6; ++i) {
    const Vector6d step = kStep * Vector6d::Unit(i);
    result.by_pose.col(i) =
        (residual(pose.perturbed(step), point) - residual(pose.perturbed(-step), point)) /
        (2.0 * kStep);
  }
  return result;
}

std::vector<std::optional<Matrix6d>> unequal_covariances(std::size_t count) {
  std::vector<std::optional<Matrix6d>> covariances;
  for (std::size_t k = 0; k < count; ++k) {
    Vector6d deviations;
    deviations << 0.02, 0.01, 0.03, 0.004, 0.006, 0.005;
    deviations *= 1.0 + static_cast<double>(k);
    covariances.emplace_back(deviations.cwiseAbs2().asDiagonal());
  }
  return covariances;
}

// A Kalman filter in its covariance form, which inverts no information.
Eigen::Matrix3d filtered(const LandmarkGraph& graph, const TrackedLandmark& landmark,
                         const std::vector<std::optional<Matrix6d>>& pose_covariances) {
  const KeypointReference& first = landmark.observations.front();
  const Eigen::Matrix3d start = derivatives(graph, first, landmark.position).by_point;
  Eigen::Matrix3d covariance =
      (start.transpose() * start + unknown_depth_information(graph, landmark)).inverse();
  for (std::size_t i = 1; i < landmark.observations.size(); ++i) {
    const KeypointReference& at = landmark.observations[i];
    const Derivatives by = derivatives(graph, at, landmark.position);
    const Matrix6d motion = *pose_covariances[first.keyframe] + *pose_covariances[at.keyframe];
    const Eigen::Matrix3d noise =
        (Eigen::Matrix3d::Identity() + by.by_pose * motion * by.by_pose.transpose()) /
        information_share(i + 1);
    const Eigen::Matrix3d innovation = by.by_point * covariance * by.by_point.transpose() + noise;
    const Eigen::Matrix3d gain = covariance * by.by_point.transpose() * innovation.inverse();
    covariance -= (gain * by.by_point * covariance).eval();
  }
  return excess_of_residuals(graph, landmark) * covariance;
}

TEST(RecursiveCovariances, AreThoseOfAKalmanFilter) {
  TrueGraph made = make_true_graph({.seed = 1, .keyframes = 5, .points = 40, .noise = 1.5});
  LandmarkGraph& graph = made.graph;
  // One whose first depth is not believed: only its order of magnitude is known.
  const KeypointReference unsure = graph.landmarks()[2].observations.front();
  graph.keyframes()[unsure.keyframe].depth_disagrees[unsure.keypoint] = true;
  ASSERT_GT(unknown_depth_information(graph, graph.landmarks()[2]).norm(), 0.0);
  const auto poses = unequal_covariances(graph.keyframes().size());
  const std::vector<Eigen::Matrix3d> found = recursive_covariances(graph, poses);
  ASSERT_EQ(found.size(), graph.landmarks().size());
  bool some_exceed = false;
  for (std::size_t l = 0; l < found.size(); ++l) {
    const TrackedLandmark& landmark = graph.landmarks()[l];
    const Eigen::Matrix3d expected = filtered(graph, landmark, poses);
    EXPECT_LT((found[l] - expected).norm(), 1e-5 * expected.norm())
        << l << ", observed " << landmark.observations.size() << " times";
    EXPECT_EQ(found[l], found[l].transpose());
    some_exceed |= excess_of_residuals(graph, landmark) > 1.5;
  }
  EXPECT_TRUE(some_exceed);
}

TEST(RecursiveCovariances, LearnNothingFromKeyframesThatNothingDetermines) {
  const TrueGraph made = make_true_graph({.seed = 2, .keyframes = 3, .points = 20});
  auto poses = unequal_covariances(3);
  poses[2].reset();
  const auto without = recursive_covariances(made.graph, poses);
  for (const double scale : {1e4, 1e8}) {
    poses[2] = scale * Matrix6d::Identity();
    const auto uncertain = recursive_covariances(made.graph, poses);
    for (std::size_t i = 0; i < without.size(); ++i) {
      EXPECT_LT((uncertain[i] - without[i]).norm(), 1e-4 * without[i].norm()) << i;
    }
  }
}

TEST(RecursiveCovariances, AreZeroForLandmarksThatAreGone) {
  TrueGraph made = make_true_graph({.seed = 2, .keyframes = 3, .points = 20});
  made.graph.remove({3});
  const auto found = recursive_covariances(made.graph, unequal_covariances(3));
  ASSERT_EQ(found.size(), made.graph.landmarks().size());
  EXPECT_TRUE(found[3].isZero());
  EXPECT_GT(found[4].trace(), 0.0);
}

TEST(KeyframePoseCovariances, AreTheInverseInformationOfLandmarksSeenElsewhereToo) {
  const TrueGraph made = make_true_graph({.seed = 3, .keyframes = 4, .points = 40});
  const LandmarkGraph& graph = made.graph;
  std::vector<Matrix6d> information(4, Matrix6d::Zero());
  bool some_seen_once = false;
  bool some_seen_twice = false;
  for (const TrackedLandmark& landmark : graph.landmarks()) {
    some_seen_once |= landmark.observations.size() == 1;
    some_seen_twice |= landmark.observations.size() == 2;
    if (landmark.observations.size() == 1) continue;
    for (const KeypointReference& at : landmark.observations) {
      const Derivatives by = derivatives(graph, at, landmark.position);
      information[at.keyframe] += by.by_pose.transpose() * by.by_pose;
    }
  }
  ASSERT_TRUE(some_seen_once && some_seen_twice);
  const auto found = keyframe_pose_covariances(graph);
  ASSERT_EQ(found.size(), 4U);
  for (std::size_t k = 0; k < found.size(); ++k) {
    const Matrix6d expected = information[k].inverse();
    EXPECT_LT((found[k].value() - expected).norm(), 1e-5 * expected.norm()) << k;
  }
}

TEST(KeyframePoseCovariances, AreUnknownWithoutLandmarks) {
  TrueGraph made = make_true_graph({.seed = 4, .keyframes = 2, .points = 20});
  Keyframe alone;
  alone.features = testing::features_of({}, {});
  made.graph.add_keyframe(std::move(alone));
  const auto found = keyframe_pose_covariances(made.graph);
  ASSERT_EQ(found.size(), 3U);
  EXPECT_FALSE(found[2]);
  EXPECT_TRUE(found[1]);
}

TEST(UnknownDepthInformation, IsAFifthOfTheDepthAlongTheFirstViewsAxis) {
  TrueGraph made = make_true_graph({.seed = 5, .keyframes = 2, .points = 20});
  LandmarkGraph& graph = made.graph;
  TrackedLandmark& landmark = graph.landmarks()[0];
  EXPECT_TRUE(unknown_depth_information(graph, landmark).isZero()) << "its depth is known";
  const KeypointReference first = landmark.observations.front();
  graph.keyframes()[first.keyframe].depth_disagrees[first.keypoint] = true;
  const Rigid3& pose = graph.keyframes()[first.keyframe].world_from_camera;
  landmark.position = pose * Eigen::Vector3d(0.4, -0.3, 2.5);
  const Eigen::Matrix3d in_camera =
      pose.rotation().transpose() * unknown_depth_information(graph, landmark) * pose.rotation();
  // The standard deviation is 0.5 m.
  const Eigen::Matrix3d expected = Eigen::Vector3d(0.0, 0.0, 4.0).asDiagonal();
  EXPECT_LT((in_camera - expected).norm(), 1e-12);
}

}  // namespace
}  // namespace cairn::detail
