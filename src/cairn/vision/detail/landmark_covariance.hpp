// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

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

/// Covariance of each keyframe's pose given the landmarks it observes; std::nullopt if these do not determine it.
std::vector<std::optional<Matrix6d>> keyframe_pose_covariances(const LandmarkGraph& graph);

}  // namespace cairn::detail
