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

/// A pose that the search came to.
struct SearchCandidate {
  Rigid3 target_from_source;
  double score = 0.0;  ///< mean of the kernel over the sampled source points, in [0, 1]
};

struct SearchOptions {
  double coarse = 0.0;  ///< scale of the kernel in the beginning
  double fine = 0.0;    ///< and in the end
  std::size_t candidates = 128;
  Execution execution = {};  ///< when stopped, what was found until then is the result
};

/// Poses that bring the source points close to target points: from each rotation with many
/// translations, by iteratively reweighted least squares with the Geman-McClure kernel
/// 1 / (1 + d²/σ²)², σ falling from coarse to fine while fewer and fewer poses stay in the running.
///
/// Every step depends on the input only, so that any number of threads gives the same poses.
///
/// @param source, target points about a centre near both, so that single precision suffices; the
///        source in random order, for the first of them are a sample of all
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
