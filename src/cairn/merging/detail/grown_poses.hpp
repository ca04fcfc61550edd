// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <functional>
#include <span>
#include <vector>

#include "cairn/merging/optimisation/optimise_poses.hpp"

namespace cairn {

/// A link of a pose graph with node indices and a positive definite covariance.
struct PoseEdge {
  std::size_t link = 0;  ///< index in the graph
  std::size_t target = 0;
  std::size_t source = 0;
  Similarity3 target_from_source;
  Matrix7d covariance;
};

/// Root mean square distance by which two poses move the node's landmarks apart, in radii.
double disagreement(const Similarity3& a, const Similarity3& b, const NodeExtent& extent);

/// Linked nodes in one frame.
struct PoseGroup {
  std::vector<std::size_t> nodes;            ///< ascending
  std::vector<Similarity3> group_from_node;  ///< one per node
};

/// Poses by growing groups: each node starts as a group; repeatedly joins the two groups between which the
/// most edges agree on the relative pose. An edge also counts once for every third group by way of which
/// other edges agree with it. A wrong edge therefore decides only if it is alone, and groups stay apart if
/// unsupported edges contradict each other.
///
/// Groups of one run grow first, so that all edges between two runs decide their relative pose.
///
/// @param runs one number per node, equal for nodes of one run
/// @param agreement see PoseOptimisationOptions; the tolerance from the edges' covariances is added
/// @param refine improves the poses of a group; called when its size has doubled, to limit accumulated
///        errors
/// @return groups, the largest first; of equal ones, that with the lowest node
std::vector<PoseGroup> grow_groups(std::span<const PoseEdge> edges,
                                   std::span<const NodeExtent> extents,
                                   std::span<const std::size_t> runs, double agreement,
                                   const std::function<void(PoseGroup& group)>& refine);

}  // namespace cairn
