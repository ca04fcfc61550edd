// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "cairn/adjustment/detail/covariance_recovery.hpp"
#include "cairn/vision/detail/landmark_graph.hpp"

namespace cairn::detail {

/// Covariance of each landmark's position relative to the keyframe that observed it first, in world axes;
/// one entry per landmark, zero for removed ones.
///
/// Recursive: starts with the covariance of the first observation's back-projection (pixel and depth noise)
/// and updates it with each further observation like an extended Kalman filter, P ← (P⁻¹ + s·JᵀR⁻¹J)⁻¹. R
/// is the measurement's noise plus the uncertainty of the motion between the two keyframes
/// (`pose_covariances`, one per keyframe); s is information_share(), because the errors of several views
/// are correlated. Observations in keyframes with an undetermined pose do not count.
std::vector<Eigen::Matrix3d> recursive_covariances(
    const LandmarkGraph& graph, const std::vector<std::optional<Matrix6d>>& pose_covariances);

/// Covariance of each keyframe's pose, given the landmarks that it observes; std::nullopt if these landmarks do
/// not determine the pose.
std::vector<std::optional<Matrix6d>> keyframe_pose_covariances(const LandmarkGraph& graph);

/// Covariances from the whole least-squares problem: all keyframes, and all landmarks with at least two
/// observations, with the first keyframe fixed.
struct MarginalCovariances {
  /// Per keyframe: covariance of its pose relative to the first keyframe, (δt, δφ) in the world.
  std::vector<Matrix6d> keyframes;
  /// Per landmark: covariance of its position relative to the keyframe that observed it first, in world axes;
  /// zero for removed landmarks.
  std::vector<Eigen::Matrix3d> landmarks;
};

/// @throws Error (misuse) for more keyframes than kMostDenseFrames
MarginalCovariances marginal_covariances(const LandmarkGraph& graph);

/// Derivatives of an observation's residuals in standard deviations, so that the covariance of the residuals is
/// the identity.
struct LinearisedObservation {
  Eigen::Matrix3d by_point;             ///< with respect to the point in the world
  Eigen::Matrix<double, 3, 6> by_pose;  ///< with respect to the left perturbation (δt, δφ)
};

LinearisedObservation linearise(const LandmarkGraph& graph, const KeypointReference& reference,
                                const Eigen::Vector3d& x_in_world);

/// Information of the n-th observation of a landmark (n = 1 is the first), relative to an independent
/// observation. Nearby views share errors of the patch's appearance and of the surface's depth. With a
/// correlation c between any two observations, n observations equal n / (1 + (n - 1)·c) independent ones; returns
/// what the n-th observation adds to this number.
double information_share(std::size_t n);

/// Mean squared residual of a landmark per degree of freedom, at least 1 (Birge ratio), by which its
/// covariance is multiplied: a landmark that does not fit, e.g. at an occluding edge, is less certain.
double excess_of_residuals(const LandmarkGraph& graph, const TrackedLandmark& landmark);

/// Prior information on the depth of a landmark whose first observation has no credible depth. It states the
/// order of magnitude of the depth, along the first view's axis; zero if the observation has a depth.
Eigen::Matrix3d unknown_depth_information(const LandmarkGraph& graph,
                                          const TrackedLandmark& landmark);

}  // namespace cairn::detail
