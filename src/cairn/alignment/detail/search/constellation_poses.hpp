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
  /// Unit of all lengths here: the fine kernel scale, about three times the landmark spacing. Positive.
  double fine = 0.0;
  std::size_t draws = 192;   ///< number of source constellations to search for in the target
  std::size_t poses = 24;    ///< largest number of proposals
  Execution execution = {};  ///< when stopped, returns what was found so far
};

/// A pose that aligns a constellation and its surroundings.
struct ConstellationPose {
  Rigid3 target_from_source;
  double evidence = 0.0;  ///< log-likelihood ratio of the landmarks around the constellation
};

/// Poses that map a constellation of three source points to three target points with the same distances,
/// and the points around it close to others. Finds maps that share only a small part, for which no coarse
/// pose stands out. Compares each constellation with the whole target (as in 4-points congruent sets, Aiger
/// et al. 2008, but with three local points), and checks each pose against the voxels occupied by target
/// points.
///
/// The same input gives the same poses for any number of threads.
/// @return distinct poses, most evidence first
std::vector<ConstellationPose> constellation_poses(std::span<const Eigen::Vector3d> source,
                                                   std::span<const Eigen::Vector3d> target,
                                                   Random random,
                                                   const ConstellationOptions& options);

}  // namespace cairn
