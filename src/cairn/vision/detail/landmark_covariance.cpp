// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/vision/detail/landmark_covariance.hpp"

#include <Eigen/LU>

#include "cairn/geometry/decompositions.hpp"
#include "cairn/vision/detail/linearisation.hpp"

namespace cairn::detail {

std::vector<std::optional<Matrix6d>> keyframe_pose_covariances(const LandmarkGraph& graph) {
  std::vector<std::optional<Matrix6d>> covariances;
  for (std::uint32_t k = 0; k < graph.keyframes().size(); ++k) {
    const Keyframe& keyframe = graph.keyframes()[k];
    Eigen::Matrix<double, 6, 6> information = Eigen::Matrix<double, 6, 6>::Zero();
    for (std::uint32_t i = 0; i < keyframe.landmarks.size(); ++i) {
      const auto& index = keyframe.landmarks[i];
      if (!index || graph.landmark(*index).observations.size() < 2) continue;
      const LinearisedObservation at = linearise(graph, {k, i}, graph.landmark(*index).position);
      information += at.by_pose.transpose() * at.by_pose;
    }
    const auto inverse = inverse_of_positive_definite(information);
    covariances.push_back(inverse ? std::optional<Matrix6d>(*inverse) : std::nullopt);
  }
  return covariances;
}

std::vector<Eigen::Matrix3d> recursive_covariances(
    const LandmarkGraph& graph, const std::vector<std::optional<Matrix6d>>& pose_covariances) {
  std::vector<Eigen::Matrix3d> covariances;
  covariances.reserve(graph.landmarks().size());
  for (const TrackedLandmark& landmark : graph.landmarks()) {
    if (landmark.gone()) {
      covariances.push_back(Eigen::Matrix3d::Zero());
      continue;
    }
    const KeypointReference& first = landmark.observations.front();
    const LinearisedObservation start = linearise(graph, first, landmark.position);
    Eigen::Matrix3d information =
        start.by_point.transpose() * start.by_point + unknown_depth_information(graph, landmark);
    for (std::size_t i = 1; i < landmark.observations.size(); ++i) {
      const KeypointReference& reference = landmark.observations[i];
      if (!pose_covariances[reference.keyframe] || !pose_covariances[first.keyframe]) continue;
      const LinearisedObservation at = linearise(graph, reference, landmark.position);
      // Motion between the two keyframes: both poses' uncertainties.
      const Eigen::Matrix<double, 6, 6> motion =
          *pose_covariances[reference.keyframe] + *pose_covariances[first.keyframe];
      const Eigen::Matrix3d noise =
          Eigen::Matrix3d::Identity() + at.by_pose * motion * at.by_pose.transpose();
      information +=
          information_share(i + 1) * at.by_point.transpose() * noise.inverse() * at.by_point;
    }
    const Eigen::Matrix3d covariance = excess_of_residuals(graph, landmark) * information.inverse();
    covariances.push_back(0.5 * (covariance + covariance.transpose()));
  }
  return covariances;
}

}  // namespace cairn::detail
