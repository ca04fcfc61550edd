// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/vision/detail/covariances.hpp"

#include <algorithm>
#include <utility>

#include <Eigen/LU>
#include <fmt/format.h>

#include "cairn/adjustment/detail/pose_derivative.hpp"
#include "cairn/core/error.hpp"
#include "cairn/geometry/decompositions.hpp"

namespace cairn::detail {
namespace {

LinearLandmark linear_landmark(const LandmarkGraph& graph, const TrackedLandmark& landmark) {
  LinearLandmark linear;
  if (landmark.gone()) return linear;
  linear.position = landmark.position;
  linear.prior = unknown_depth_information(graph, landmark);
  for (std::size_t i = 0; i < landmark.observations.size(); ++i) {
    const LinearisedObservation at = linearise(graph, landmark.observations[i], landmark.position);
    linear.observations.push_back(
        {landmark.observations[i].keyframe, information_share(i + 1), at.by_point, at.by_pose});
  }
  return linear;
}

}  // namespace

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

MarginalCovariances marginal_covariances(const LandmarkGraph& graph) {
  const std::size_t count = graph.keyframes().size();
  if (count > kMostDenseFrames) {
    throw Error(ErrorKind::kMisuse, "marginal covariances", fmt::format("{} keyframes", count),
                fmt::format("at most {}; cut the sequence into mini-maps", kMostDenseFrames));
  }
  LinearProblem problem;
  for (const Keyframe& keyframe : graph.keyframes()) {
    problem.camera_centres.push_back(keyframe.world_from_camera.translation());
  }
  for (const TrackedLandmark& landmark : graph.landmarks()) {
    problem.landmarks.push_back(linear_landmark(graph, landmark));
  }
  RecoveredCovariances recovered = recover_covariances(problem, CovarianceGauge::kFirstObserver);
  for (std::size_t l = 0; l < graph.landmarks().size(); ++l) {
    const TrackedLandmark& landmark = graph.landmarks()[l];
    if (!landmark.gone()) recovered.landmarks[l] *= excess_of_residuals(graph, landmark);
  }
  return {std::move(recovered.frames), std::move(recovered.landmarks)};
}

}  // namespace cairn::detail
