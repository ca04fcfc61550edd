// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/vision/detail/bundle_adjustment.hpp"

#include <algorithm>
#include <numeric>

#include <gtest/gtest.h>

#include "cairn/vision/detail/covariances.hpp"

#include "support/landmark_graphs.hpp"

namespace cairn::detail {
namespace {

using testing::make_true_graph;
using testing::random_step;
using testing::random_vector;
using testing::TrueGraph;

std::vector<std::uint32_t> all_but_the_first(const LandmarkGraph& graph) {
  std::vector<std::uint32_t> moving(graph.keyframes().size() - 1);
  std::iota(moving.begin(), moving.end(), 1U);
  return moving;
}

void disturb(LandmarkGraph& graph, std::span<const std::uint32_t> keyframes, double metres,
             double radians, double landmark_metres) {
  Random random(9);
  for (const std::uint32_t k : keyframes) {
    Rigid3& pose = graph.keyframes()[k].world_from_camera;
    pose = pose.perturbed(random_step(random, metres, radians));
  }
  for (TrackedLandmark& landmark : graph.landmarks()) {
    landmark.position += random_vector(random, landmark_metres);
  }
}

struct Errors {
  double translation = 0.0;  // largest
  double rotation = 0.0;
  double landmark = 0.0;  // median, of those observed twice
};

Errors errors_of(const TrueGraph& made) {
  Errors errors;
  for (std::size_t k = 0; k < made.poses.size(); ++k) {
    const Vector6d off = made.poses[k].difference_to(made.graph.keyframes()[k].world_from_camera);
    errors.translation = std::max(errors.translation, off.head<3>().norm());
    errors.rotation = std::max(errors.rotation, off.tail<3>().norm());
  }
  std::vector<double> landmarks;
  for (std::size_t i = 0; i < made.points.size(); ++i) {
    const TrackedLandmark& landmark = made.graph.landmarks()[i];
    if (landmark.observations.size() < 2) continue;
    landmarks.push_back((landmark.position - made.points[i]).norm());
  }
  std::nth_element(landmarks.begin(),
                   landmarks.begin() + static_cast<std::ptrdiff_t>(landmarks.size() / 2),
                   landmarks.end());
  errors.landmark = landmarks[landmarks.size() / 2];
  return errors;
}

TEST(Adjust, FindsTheTruthOfExactMeasurements) {
  TrueGraph made = make_true_graph({.seed = 1, .noise = 0.0});
  const auto moving = all_but_the_first(made.graph);
  disturb(made.graph, moving, 0.02, 0.01, 0.02);
  adjust(made.graph, moving, 50);
  const Errors errors = errors_of(made);
  EXPECT_LT(errors.translation, 1e-3);
  EXPECT_LT(errors.rotation, 1e-3);
  EXPECT_LT(errors.landmark, 1e-3);
}

TEST(Adjust, ComesNearTheTruthOfNoisyMeasurements) {
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    TrueGraph made = make_true_graph({.seed = seed});
    const auto moving = all_but_the_first(made.graph);
    disturb(made.graph, moving, 0.03, 0.02, 0.03);
    adjust(made.graph, moving, 30);
    const Errors errors = errors_of(made);
    EXPECT_LT(errors.translation, 0.015) << seed;
    EXPECT_LT(errors.rotation, 0.005) << seed;
    EXPECT_LT(errors.landmark, 0.02) << seed;
  }
}

TEST(Adjust, LeavesKeyframesThatDoNotMoveUntouchedToTheBit) {
  TrueGraph made = make_true_graph({.seed = 2});
  const std::vector<std::uint32_t> moving = {1, 3};
  disturb(made.graph, moving, 0.03, 0.02, 0.02);
  std::vector<Matrix4d> before;
  for (const Keyframe& keyframe : made.graph.keyframes()) {
    before.push_back(keyframe.world_from_camera.matrix());
  }
  adjust(made.graph, moving, 30);
  for (const std::size_t k : {0U, 2U, 4U}) {
    EXPECT_EQ(made.graph.keyframes()[k].world_from_camera.matrix(), before[k]) << k;
  }
  const Errors errors = errors_of(made);
  EXPECT_LT(errors.translation, 0.012);
  EXPECT_LT(errors.rotation, 0.004);
  for (const std::size_t k : moving) {
    EXPECT_NE(made.graph.keyframes()[k].world_from_camera.matrix(), before[k]) << k;
  }
}

TEST(Adjust, SameInputSameBits) {
  std::vector<Matrix4d> poses[2];
  for (auto& run : poses) {
    TrueGraph made = make_true_graph({.seed = 3});
    const auto moving = all_but_the_first(made.graph);
    disturb(made.graph, moving, 0.03, 0.02, 0.03);
    adjust(made.graph, moving);
    for (const Keyframe& keyframe : made.graph.keyframes()) {
      run.push_back(keyframe.world_from_camera.matrix());
    }
  }
  EXPECT_EQ(poses[0], poses[1]);
}

// Wrong pixels are dropped; a wrong depth is told apart and its observation kept.
TEST(Adjust, DropsWhatTheNoiseDoesNotExplain) {
  TrueGraph made = make_true_graph({.seed = 4, .keyframes = 6, .points = 200});
  std::vector<KeypointReference> wrong_pixels;
  std::vector<KeypointReference> wrong_depths;
  for (const TrackedLandmark& landmark : made.graph.landmarks()) {
    if (landmark.observations.size() < 4) continue;
    const KeypointReference at = landmark.observations[2];
    Features& features = made.graph.keyframes()[at.keyframe].features;
    std::vector<Keypoint> keypoints(features.keypoints().begin(), features.keypoints().end());
    Keypoint& keypoint = keypoints[at.keypoint];
    if (wrong_pixels.size() < 15) {
      keypoint.pixel += Eigen::Vector2f(12.0F, -9.0F);
      wrong_pixels.push_back(at);
    } else if (wrong_depths.size() < 15 && keypoint.depth_m > 0.0F) {
      keypoint.depth_m *= 1.3F;
      wrong_depths.push_back(at);
    }
    features = testing::features_of(keypoints,
                                    {features.descriptors().begin(), features.descriptors().end()});
  }
  ASSERT_EQ(wrong_depths.size(), 15U);
  const auto moving = all_but_the_first(made.graph);
  disturb(made.graph, moving, 0.01, 0.005, 0.01);
  adjust(made.graph, moving, 30);
  for (const KeypointReference& at : wrong_pixels) {
    EXPECT_FALSE(made.graph.keyframes()[at.keyframe].landmarks[at.keypoint]);
  }
  int kept = 0;
  for (const KeypointReference& at : wrong_depths) {
    const Keyframe& keyframe = made.graph.keyframes()[at.keyframe];
    EXPECT_TRUE(keyframe.depth_disagrees[at.keypoint]);
    EXPECT_FALSE(made.graph.measurement(at).has_depth());
    kept += keyframe.landmarks[at.keypoint] ? 1 : 0;
  }
  EXPECT_GE(kept, 13);
  EXPECT_LT(errors_of(made).translation, 0.012);
}

TEST(Adjust, LandmarksOfOneViewStayWhereTheyAreInIt) {
  TrueGraph made = make_true_graph({.seed = 5, .points = 200, .seen_again = 0.5});
  const auto moving = all_but_the_first(made.graph);
  disturb(made.graph, moving, 0.02, 0.01, 0.0);
  std::vector<std::pair<LandmarkIndex, Eigen::Vector3d>> in_camera;
  const auto seen = [&](const TrackedLandmark& landmark) -> Eigen::Vector3d {
    const std::uint32_t first = landmark.observations.front().keyframe;
    return made.graph.keyframes()[first].world_from_camera.inverse() * landmark.position;
  };
  for (std::uint32_t i = 0; i < made.graph.landmarks().size(); ++i) {
    const TrackedLandmark& landmark = made.graph.landmark({i});
    if (landmark.observations.size() == 1) in_camera.emplace_back(LandmarkIndex{i}, seen(landmark));
  }
  ASSERT_FALSE(in_camera.empty());
  adjust(made.graph, moving);
  for (const auto& [index, before] : in_camera) {
    ASSERT_EQ(made.graph.landmark(index).observations.size(), 1U);
    EXPECT_LT((seen(made.graph.landmark(index)) - before).norm(), 1e-9);
  }
}

TEST(Adjust, NothingToDoIsNoError) {
  LandmarkGraph empty(testing::test_sensor());
  EXPECT_NO_THROW(adjust(empty, {}));
  TrueGraph made = make_true_graph({.seed = 6, .keyframes = 1});
  const std::vector<std::uint32_t> moving = {0};
  adjust(made.graph, moving);  // nothing is observed twice
  EXPECT_EQ(made.graph.keyframes()[0].world_from_camera.matrix(), made.poses[0].matrix());
}

Eigen::Vector3d residual_at(const PointMeasurement& measured, const Rigid3& world_from_camera,
                            const Eigen::Vector3d& x_in_world) {
  return point_residual(testing::kTestPinhole, measured, world_from_camera.inverse() * x_in_world)
      .value;
}

TEST(Linearise, DerivativesAreThoseOfTheResidual) {
  const TrueGraph made = make_true_graph({.seed = 7, .keyframes = 3, .points = 30});
  constexpr double kStep = 1e-6;
  for (const TrackedLandmark& landmark : made.graph.landmarks()) {
    for (const KeypointReference& at : landmark.observations) {
      const Rigid3& pose = made.graph.keyframes()[at.keyframe].world_from_camera;
      const PointMeasurement measured = made.graph.measurement(at);
      const LinearisedObservation found = linearise(made.graph, at, landmark.position);
      Eigen::Matrix3d by_point;
      for (int i = 0; i < 3; ++i) {
        const Eigen::Vector3d step = kStep * Eigen::Vector3d::Unit(i);
        by_point.col(i) = (residual_at(measured, pose, landmark.position + step) -
                           residual_at(measured, pose, landmark.position - step)) /
                          (2.0 * kStep);
      }
      Eigen::Matrix<double, 3, 6> by_pose;
      for (int i = 0; i < 6; ++i) {
        const Vector6d step = kStep * Vector6d::Unit(i);
        by_pose.col(i) = (residual_at(measured, pose.perturbed(step), landmark.position) -
                          residual_at(measured, pose.perturbed(-step), landmark.position)) /
                         (2.0 * kStep);
      }
      EXPECT_LT((found.by_point - by_point).norm(), 1e-5 * by_point.norm());
      EXPECT_LT((found.by_pose - by_pose).norm(), 1e-5 * by_pose.norm());
    }
  }
}

}  // namespace
}  // namespace cairn::detail
