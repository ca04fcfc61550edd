// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <vector>

#include "cairn/adjustment/covariance_recovery.hpp"
#include "cairn/vision/detail/landmark_graph.hpp"

namespace cairn::detail {

/// Covariances from the whole least-squares problem: all keyframes, and all landmarks with at least two
/// observations, with the first keyframe fixed.
struct MarginalCovariances {
  /// Per keyframe: of its pose relative to the first, (δt, δφ) in the world.
  std::vector<Matrix6d> keyframes;
  /// Per landmark: of its position relative to the keyframe that observed it first, in world axes; zero for
  /// removed ones.
  std::vector<Eigen::Matrix3d> landmarks;
};

/// Largest number of keyframes, because the problem is solved densely.
inline constexpr std::size_t kMostMarginalKeyframes = kMostDenseFrames;

/// @throws Error (misuse) for more keyframes than kMostMarginalKeyframes
MarginalCovariances marginal_covariances(const LandmarkGraph& graph);

}  // namespace cairn::detail
