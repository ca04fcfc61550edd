// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "cairn/core/execution.hpp"
#include "cairn/core/random.hpp"
#include "cairn/geometry/rigid3.hpp"

namespace cairn {

struct ConstellationOptions {
  /// Unit of all lengths here: the fine scale of the kernel, so that landmarks are about a third of it
  /// apart. Positive.
  double fine = 0.0;
  std::size_t draws = 192;   ///< constellations of the source that are looked for in the target
  std::size_t poses = 24;    ///< at most so many are proposed
  Execution execution = {};  ///< when stopped, what was found until then is the result
};

/// A pose that brings landmarks about a constellation close to others.
struct ConstellationPose {
  Rigid3 target_from_source;
  double evidence = 0.0;  ///< of the landmarks about it; natural logarithm of a likelihood ratio
};

/// Poses that bring a constellation of three source points to three target points as far from each
/// other, and the points about it close to others: what maps that share a small part have in common,
/// where no coarse pose stands out. Each constellation is compared with all of the target (as in
/// 4-points congruent sets, Aiger et al. 2008, but of three points and local), and each pose is checked
/// against the voxels that target points are in.
///
/// Same input, same poses, whatever the number of threads.
/// @return distinct poses, most evidence first
std::vector<ConstellationPose> constellation_poses(std::span<const Eigen::Vector3d> source,
                                                   std::span<const Eigen::Vector3d> target,
                                                   Random random,
                                                   const ConstellationOptions& options);

}  // namespace cairn
