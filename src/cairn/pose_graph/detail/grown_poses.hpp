// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "cairn/pose_graph/detail/pose_edges.hpp"

namespace cairn::detail {

/// Linked nodes in one frame.
struct PoseGroup {
  std::vector<std::size_t> nodes;            ///< ascending
  std::vector<Similarity3> group_from_node;  ///< one per node
};

/// Finds poses by growing groups. Each node starts as a group. Then the two groups between which the most
/// edges agree on the relative pose are joined, again and again. An edge also counts once for every third
/// group through which other edges agree with it. A wrong edge therefore decides only if it is alone.
/// Groups stay apart if unsupported edges contradict each other.
///
/// Groups of one run grow first, so that all edges between two runs decide their relative pose.
///
/// @param runs one number per node, equal for nodes of one run
/// @param agreement see PoseOptimisationOptions; the tolerance from the edges' covariances is added
/// @param placed    pose of each node that was placed before; these nodes start as one group. Empty: no
///        node was placed
/// @param refine improves the poses of a group; called when the group's size has doubled, to limit
///        accumulated errors
/// @return groups, the largest first; of equally large groups, that with the lowest node first
std::vector<PoseGroup> grow_groups(std::span<const PoseEdge> edges,
                                   std::span<const NodeExtent> extents,
                                   std::span<const std::size_t> runs, double agreement,
                                   const std::function<void(PoseGroup& group)>& refine,
                                   std::span<const std::optional<Similarity3>> placed = {});

}  // namespace cairn::detail
