// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <span>

#include "cairn/registration/correspondence/confident_neighbor.hpp"
#include "cairn/registration/icp.hpp"
#include "cairn/registration/neighbors/batch_tree.hpp"

namespace cairn::detail {

/// Columns of equal length; the second and third may be empty.
struct SampledPoints {
  std::span<const Eigen::Vector3d> positions;
  std::span<const double> confidences;
  std::span<const double> weights;  ///< not negative; points of weight 0 are never sampled
};

/// Result of align_samples().
struct CoarseAlignment {
  Rigid3 target_from_source;
  int iterations = 0;  ///< total of all samples
};

/// Aligns a sample of the source to a sample of the target, then samples four times as large from the
/// resulting pose, and so on. The alignment of all points is left to the caller. Far from the optimum, a
/// sample determines the step as well as all points do; fewer target points also make steps longer and the
/// basin of convergence wider.
///
/// A sample takes one random point of each 4, 16, ... consecutive ones, and at least a few hundred points;
/// a small source is not sampled. The iteration on a sample ends when a step is shorter than the sampling
/// error of the pose, √(mean squared match distance / points). With a maximum match distance, which assumes
/// the target's density, the target is not sampled.
///
/// @param source  points near the target; their confidences matter only for reciprocal matches
/// @param options reciprocal matches are those within a sample; `initial` has no effect
CoarseAlignment align_samples(const SampledPoints& source, const ConfidentSet<BatchTree>& target,
                              const IcpOptions& options, const Execution& execution = {});

}  // namespace cairn::detail
