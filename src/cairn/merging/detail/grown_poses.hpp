// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <functional>
#include <span>
#include <vector>

#include "cairn/merging/optimisation/optimise_poses.hpp"

namespace cairn {

/// A link of a pose graph by indices of its nodes, with a positive definite covariance.
struct PoseEdge {
  std::size_t link = 0;  ///< of the graph
  std::size_t target = 0;
  std::size_t source = 0;
  Similarity3 target_from_source;
  Matrix7d covariance;
};

/// Root mean square of how far two poses move the node's landmarks apart, in radii.
double disagreement(const Similarity3& a, const Similarity3& b, const NodeExtent& extent);

/// Nodes that edges connect, in one frame.
struct PoseGroup {
  std::vector<std::size_t> nodes;            ///< ascending
  std::vector<Similarity3> group_from_node;  ///< beside the nodes
};

/// Poses by groups that grow together: each node is a group at first, and again and again the two groups
/// become one between which the most edges agree on how they lie. An edge also counts once for every third
/// group by way of which others say the same. So a wrong edge decides only where no other speaks, and where
/// edges contradict each other and none has another on its side, groups stay apart.
///
/// Groups of one run grow first: how two runs lie to each other is then decided by all edges between them.
///
/// @param runs      beside the extents: nodes of one run have one number
/// @param agreement see PoseOptimisationOptions; what the edges' covariances allow comes to it
/// @param refine    improves the poses of a group; called when it has doubled, so that errors do not pile up
/// @return groups, the largest first; of those as large the one with the lowest node
std::vector<PoseGroup> grow_groups(std::span<const PoseEdge> edges,
                                   std::span<const NodeExtent> extents,
                                   std::span<const std::size_t> runs, double agreement,
                                   const std::function<void(PoseGroup& group)>& refine);

}  // namespace cairn
