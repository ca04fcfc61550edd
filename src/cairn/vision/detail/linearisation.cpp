// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/vision/detail/linearisation.hpp"

#include <algorithm>

namespace cairn::detail {

LinearisedObservation linearise(const LandmarkGraph& graph, const KeypointReference& reference,
                                const Eigen::Vector3d& x_in_world) {
  const Rigid3& pose = graph.keyframes()[reference.keyframe].world_from_camera;
  const Eigen::Matrix3d camera_from_world = pose.rotation().transpose();
  const Eigen::Vector3d arm = x_in_world - pose.translation();
  Eigen::Vector3d x_in_camera = camera_from_world * arm;
  x_in_camera.z() = std::max(x_in_camera.z(), kNearestDepth);
  const PointResidual residual =
      point_residual(graph.sensor().pinhole(), graph.measurement(reference), x_in_camera);
  LinearisedObservation at;
  at.by_point = residual.by_x_in_camera * camera_from_world;
  at.by_pose = derivative_by_pose(at.by_point, arm);
  return at;
}

double information_share(std::size_t n) {
  constexpr double kCorrelation = 0.3;
  const auto worth = [](double count) { return count / (1.0 + (count - 1.0) * kCorrelation); };
  const auto count = static_cast<double>(n);
  return n <= 1 ? 1.0 : worth(count) - worth(count - 1.0);
}

double excess_of_residuals(const LandmarkGraph& graph, const TrackedLandmark& landmark) {
  double sum = 0.0;
  int rows = 0;
  for (const KeypointReference& reference : landmark.observations) {
    const Keyframe& keyframe = graph.keyframes()[reference.keyframe];
    const Eigen::Vector3d x_in_camera = keyframe.world_from_camera.inverse() * landmark.position;
    if (x_in_camera.z() < kNearestDepth) continue;
    // Includes disabled depths, which also show that a landmark does not fit.
    const PointMeasurement measured =
        graph.sensor().measurement(keyframe.features.keypoints()[reference.keypoint]);
    sum += point_residual(graph.sensor().pinhole(), measured, x_in_camera).value.squaredNorm();
    rows += measured.has_depth() ? 3 : 2;
  }
  constexpr int kUnknowns = 3;
  return rows > kUnknowns ? std::max(1.0, sum / (rows - kUnknowns)) : 1.0;
}

Eigen::Matrix3d unknown_depth_information(const LandmarkGraph& graph,
                                          const TrackedLandmark& landmark) {
  const KeypointReference& first = landmark.observations.front();
  if (graph.measurement(first).has_depth()) return Eigen::Matrix3d::Zero();
  const Rigid3& pose = graph.keyframes()[first.keyframe].world_from_camera;
  const Eigen::Vector3d axis = pose.rotation().col(2);
  const double depth = std::max(axis.dot(landmark.position - pose.translation()), kNearestDepth);
  constexpr double kShare = 0.2;
  return axis * axis.transpose() / (kShare * depth * kShare * depth);
}

}  // namespace cairn::detail
