// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/odometry/linearisation.hpp"

#include <algorithm>

namespace cairn {

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
  at.by_pose.leftCols<3>() = -at.by_point;
  at.by_pose.rightCols<3>() = at.by_point * skew(arm);
  return at;
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

}  // namespace cairn
