// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <span>

#include "cairn/merging/optimisation/optimise_poses.hpp"

namespace cairn {

/// Updates the poses of a graph to which nodes and links were added, at the cost of their neighbourhood.
///
/// New nodes join the placed ones by the votes of their links, as in optimise_poses(). Only poses near the new
/// nodes and links are then optimised; the others are fixed. The neighbourhood grows until the poses at its
/// edge move by less than a twentieth of the standard deviation of their links, and all its links agree.
///
/// Differs from optimise_poses() in two ways. Links that were used before stay unless the new ones contradict
/// them nearby; a wrong majority is therefore not reconsidered. Covariances of placed nodes do not shrink, and
/// those of new ones are upper bounds, unless the neighbourhood is the whole graph.
///
/// If the frame would change, or the new links break the group apart, the result is that of optimise_poses().
///
/// @param before of the graph before the additions, but with an entry per present node and link: no pose for
///        new nodes, `false` for new links; its tree is ignored
/// @throws Error (misuse) for invalid options or extents or an entry missing, (input) for an invalid graph
OptimisedPoses update_poses(const PoseGraph& graph, std::span<const NodeExtent> extents,
                            const OptimisedPoses& before,
                            const PoseOptimisationOptions& options = {});

}  // namespace cairn
