// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/odometry/landmark_covariance.hpp"

#include <Eigen/Cholesky>
#include <Eigen/LU>

namespace cairn {
namespace {

using Jacobian6 = Eigen::Matrix<double, 3, 6>;

struct Linearised {
  Eigen::Matrix3d by_point;  // in the world
  Jacobian6 by_pose;
  bool has_depth = false;
};

// Residuals are in standard deviations, so their covariance is the identity.
Linearised linearise(const LandmarkGraph& graph, const KeypointReference& reference,
                     const Eigen::Vector3d& x_in_world) {
  const Rigid3& pose = graph.keyframes()[reference.keyframe].world_from_camera;
  const PointMeasurement measured = graph.measurement(reference);
  const Eigen::Matrix3d camera_from_world = pose.rotation().transpose();
  const Eigen::Vector3d arm = x_in_world - pose.translation();
  Eigen::Vector3d x_in_camera = camera_from_world * arm;
  x_in_camera.z() = std::max(x_in_camera.z(), kNearestDepth);
  const PointResidual residual = point_residual(graph.sensor().pinhole(), measured, x_in_camera);
  Linearised at;
  at.by_point = residual.by_x_in_camera * camera_from_world;
  at.by_pose.leftCols<3>() = -at.by_point;
  at.by_pose.rightCols<3>() = at.by_point * skew(arm);
  at.has_depth = measured.has_depth();
  return at;
}

}  // namespace

std::vector<Matrix6d> keyframe_pose_covariances(const LandmarkGraph& graph) {
  std::vector<Matrix6d> covariances;
  for (std::uint32_t k = 0; k < graph.keyframes().size(); ++k) {
    const Keyframe& keyframe = graph.keyframes()[k];
    Eigen::Matrix<double, 6, 6> information = Eigen::Matrix<double, 6, 6>::Zero();
    for (std::uint32_t i = 0; i < keyframe.landmarks.size(); ++i) {
      const auto& index = keyframe.landmarks[i];
      if (!index || graph.landmark(*index).observations.size() < 2) continue;
      const Linearised at = linearise(graph, {k, i}, graph.landmark(*index).position);
      information += at.by_pose.transpose() * at.by_pose;
    }
    const Eigen::LDLT<Eigen::Matrix<double, 6, 6>> solver(information);
    Matrix6d covariance = Matrix6d::Zero();
    if (solver.info() == Eigen::Success && solver.vectorD().minCoeff() > 0.0) {
      covariance = solver.solve(Eigen::Matrix<double, 6, 6>::Identity());
    }
    covariances.push_back(covariance);
  }
  return covariances;
}

std::vector<Eigen::Matrix3d> recursive_covariances(const LandmarkGraph& graph,
                                                   const std::vector<Matrix6d>& pose_covariances) {
  std::vector<Eigen::Matrix3d> covariances;
  covariances.reserve(graph.landmarks().size());
  const SensorModel& sensor = graph.sensor();
  for (const TrackedLandmark& landmark : graph.landmarks()) {
    if (landmark.gone()) {
      covariances.push_back(Eigen::Matrix3d::Zero());
      continue;
    }
    // Start: the first keyframe's own measurement. Depth that is not known to this camera's range.
    const KeypointReference& first = landmark.observations.front();
    const Linearised start = linearise(graph, first, landmark.position);
    Eigen::Matrix3d information = start.by_point.transpose() * start.by_point;
    if (!start.has_depth) {
      const Rigid3& pose = graph.keyframes()[first.keyframe].world_from_camera;
      const Eigen::Vector3d axis = pose.rotation().col(2);
      const double depth = std::max(axis.dot(landmark.position - pose.translation()), kNearestDepth);
      // The reading was left out for being wrong: it says no more than the order of magnitude.
      const double sigma = std::max(0.2 * depth, sensor.sigma_depth_m(depth));
      information += axis * axis.transpose() / (sigma * sigma);
    }
    for (std::size_t i = 1; i < landmark.observations.size(); ++i) {
      const KeypointReference& reference = landmark.observations[i];
      const Linearised at = linearise(graph, reference, landmark.position);
      // Motion between the two keyframes: both poses' uncertainties.
      const Eigen::Matrix<double, 6, 6> motion =
          pose_covariances[reference.keyframe] + pose_covariances[first.keyframe];
      const Eigen::Matrix3d noise =
          Eigen::Matrix3d::Identity() + at.by_pose * motion * at.by_pose.transpose();
      information += at.by_point.transpose() * noise.inverse() * at.by_point;
    }
    covariances.push_back(information.inverse());
  }
  return covariances;
}

}  // namespace cairn
