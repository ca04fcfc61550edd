// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <span>
#include <stop_token>

#include "cairn/core/executor.hpp"
#include "cairn/registration/correspondence/confident_neighbor.hpp"
#include "cairn/registration/neighbors/batch_tree.hpp"

namespace cairn {

struct CoarseToFineOptions {
  ConfidentNeighborOptions matching = {};
  bool reciprocal = false;   ///< keep only matches that hold both ways, within the sample
  int max_iterations = 150;  ///< on each sample
  Executor executor = Executor();
  std::stop_token stop = {};
};

/// What an alignment moves: columns of one length; the second may be empty if no match need hold both
/// ways, the third if all points weigh alike in the estimate.
struct MovingPoints {
  std::span<const Eigen::Vector3d> positions;
  std::span<const double> confidences;
  std::span<const double> weights;  ///< not negative; a point without weight is in no sample
};

/// Where an alignment of samples has come to.
struct CoarseAlignment {
  Rigid3 target_from_source;
  int iterations = 0;  ///< on all samples together
};

/// Aligns samples of the source, each four times the one before, starting where that ended; all of the
/// source is left to the caller. Far from the end a sample tells the way as well as all points do.
///
/// A sample has one random point of each 4, 16, ... in a row, and a few hundred at least: of a small
/// source there are none. It is done with when a step is shorter than what chance in the choice of
/// its points makes of the pose, √(mean squared match distance / points).
///
/// @param source near the target
CoarseAlignment align_samples(const MovingPoints& source, const ConfidentSet<BatchTree>& target,
                              const CoarseToFineOptions& options);

}  // namespace cairn
