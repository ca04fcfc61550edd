// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <span>

#include "cairn/core/execution.hpp"
#include "cairn/registration/convergence/pcl_criteria.hpp"
#include "cairn/registration/correspondence/confident_neighbor.hpp"
#include "cairn/registration/neighbors/batch_tree.hpp"

namespace cairn {

struct CoarseToFineOptions {
  ConfidentNeighborOptions matching = {};
  bool reciprocal = false;  ///< keep only matches that hold both ways, within the sample
  int max_iterations = PclCriteria().max_iterations;  ///< on each sample
  Execution execution = {};
};

/// Columns of one length; the second and third may be empty.
struct SampledPoints {
  std::span<const Eigen::Vector3d> positions;
  std::span<const double> confidences;
  std::span<const double> weights;  ///< not negative; a point without weight is in no sample
};

/// Where an alignment of samples has come to.
struct CoarseAlignment {
  Rigid3 target_from_source;
  int iterations = 0;  ///< on all samples together
};

/// Aligns a sample of the source to one of the target, then samples four times as large, starting where
/// that ended, and so on; all points are left to the caller. Far from the end a sample tells the way as
/// well as all points do; and among fewer target points steps are longer and the basin is wider.
///
/// A sample has one random point of each 4, 16, ... in a row, and a few hundred at least: of a small
/// source there are none. It is done with when a step is shorter than what chance in the choice of
/// its points makes of the pose, √(mean squared match distance / points). With a limit to the distance of
/// a match, which holds for the target's density, the target is not sampled.
///
/// @param source near the target; its confidences matter if matches have to hold both ways
CoarseAlignment align_samples(const SampledPoints& source, const ConfidentSet<BatchTree>& target,
                              const CoarseToFineOptions& options);

}  // namespace cairn
