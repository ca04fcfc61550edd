// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/vision/detail/marginal_covariance.hpp"

#include <utility>

#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/vision/detail/linearisation.hpp"

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

MarginalCovariances marginal_covariances(const LandmarkGraph& graph) {
  const std::size_t count = graph.keyframes().size();
  if (count > kMostMarginalKeyframes) {
    throw Error(ErrorKind::kMisuse, "marginal covariances", fmt::format("{} keyframes", count),
                fmt::format("at most {}; cut the sequence into mini-maps", kMostMarginalKeyframes));
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
