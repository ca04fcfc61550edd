// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "cairn/core/execution.hpp"
#include "cairn/geometry/rigid3.hpp"

namespace cairn {

/// A pose found by the search.
struct SearchCandidate {
  Rigid3 target_from_source;
  double score = 0.0;  ///< mean of the kernel over the sampled source points, in [0, 1]
};

struct SearchOptions {
  double coarse = 0.0;  ///< initial kernel scale
  double fine = 0.0;    ///< final kernel scale
  std::size_t candidates = 128;
  Execution execution = {};  ///< when stopped, returns what was found so far
};

/// Poses that bring source points close to target points: from each rotation with many translations, by
/// iteratively reweighted least squares with the Geman-McClure kernel 1 / (1 + d²/σ²)², with σ decreasing
/// from coarse to fine while ever fewer poses are kept.
///
/// Each step depends only on the input, so any number of threads gives the same poses.
///
/// @param source, target points centred near both centroids, so that single precision suffices; the source
///        in random order, because its first points are the sample
/// @param accept  whether a pose may be a candidate
/// @return distinct poses, best score first
std::vector<SearchCandidate> search_poses(std::span<const Eigen::Vector3d> source,
                                          std::span<const double> source_weights,
                                          std::span<const Eigen::Vector3d> target,
                                          std::span<const double> target_weights,
                                          std::span<const Eigen::Quaterniond> rotations,
                                          const std::function<bool(const Rigid3&)>& accept,
                                          const SearchOptions& options);

}  // namespace cairn
