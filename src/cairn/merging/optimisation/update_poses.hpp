// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <span>

#include "cairn/merging/optimisation/optimise_poses.hpp"

namespace cairn {

/// Updates the poses of a graph to which nodes and links were added, without voting anew on the links used before.
///
/// New nodes join the placed ones by the votes of their links, as in optimise_poses(). All used links are then
/// optimised from the poses before, which takes few iterations, and all covariances are those of the used links.
///
/// Differs from optimise_poses() in that links that were used before stay unless the new ones contradict them; a
/// wrong majority is therefore not reconsidered. If the same links are used, so are poses and covariances.
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
