// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <vector>

#include "cairn/adjustment/covariance_recovery.hpp"
#include "cairn/odometry/landmark_graph.hpp"

namespace cairn {

/// Covariances from the whole least-squares problem: all keyframes and landmarks with two or more
/// observations at once, with the first keyframe fixed.
struct MarginalCovariances {
  /// Of each keyframe's pose relative to the first, as Cairn's pose covariances in the world.
  std::vector<Matrix6d> keyframes;
  /// Of each landmark's position relative to the keyframe that observed it first, in world axes;
  /// zero for those that are gone.
  std::vector<Eigen::Matrix3d> landmarks;
};

/// More keyframes than this cost too much: the problem is solved densely.
inline constexpr std::size_t kMostMarginalKeyframes = kMostDenseFrames;

/// @throws Error (misuse) with more keyframes than kMostMarginalKeyframes
MarginalCovariances marginal_covariances(const LandmarkGraph& graph);

}  // namespace cairn
