// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include <Eigen/Core>

#include "cairn/odometry/landmark_graph.hpp"

namespace cairn {

/// Covariance of each landmark's position relative to the keyframe that observed it first, in world
/// axes; one entry per landmark, zero for those that are gone.
///
/// Recursive: it starts with the covariance of the first observation's back-projection (pixel and
/// depth noise) and is updated by each further observation as an extended Kalman filter does,
/// P ← (P⁻¹ + s·JᵀR⁻¹J)⁻¹. R holds the measurement's own noise and what the uncertain motion between
/// the two keyframes (`pose_covariances`, one per keyframe) adds to it; s is information_share(), for
/// the errors of several views are not independent.
std::vector<Eigen::Matrix3d> recursive_covariances(const LandmarkGraph& graph,
                                                   const std::vector<Matrix6d>& pose_covariances);

/// Covariance of each keyframe's pose given the landmarks it observes.
std::vector<Matrix6d> keyframe_pose_covariances(const LandmarkGraph& graph);

}  // namespace cairn
