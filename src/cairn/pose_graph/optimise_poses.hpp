// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "cairn/core/option_table.hpp"
#include "cairn/pose_graph/pose_graph.hpp"

namespace cairn {

/// Extent of a node's landmarks in the node's frame; the reference for pose comparison.
struct NodeExtent {
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  double radius = 1.0;  ///< median distance from the centre; positive
};

/// Computes centre and radius by medians, robust to outliers.
/// @param landmarks positions in the node's frame
NodeExtent node_extent(std::span<const Eigen::Vector3d> landmarks);

/// Options of optimise_poses().
struct PoseOptimisationOptions {
  /// Largest disagreement of two poses of a node that agree; in (0, 1]. The disagreement is the
  /// root of the sum of squares of the centre's shift (in radii of the node), the rotation
  /// (radians) and the difference of the logarithms of scale.
  double agreement = 0.1;
  int max_iterations = 100;  ///< iteration limit of the solver

  static const OptionTable table;
  /// @throws Error (misuse) naming the field, its value and the constraint
  void validate() const;
};

struct OptimisedPoses {
  /// Poses of the largest linked group, one per node; std::nullopt for other nodes. The pose of the
  /// group's first node is the identity. Of equally large groups, the group with the first node
  /// counts.
  std::vector<std::optional<Similarity3>> world_from_node;
  /// One per node: left perturbation in the world, (δt, δφ, δ log s); zero for the group's first
  /// node.
  std::vector<Matrix7d> covariances;
  /// Per link: whether both nodes are in the group and the link agrees with their poses.
  /// Disagreeing links were not used.
  std::vector<bool> agrees;
  /// Indices of the links of the most certain spanning tree, in the order in which it grows from
  /// the first node.
  std::vector<std::size_t> tree;
};

/// Computes the poses of the largest linked group in one frame.
///
/// Initial poses: groups of nodes are joined step by step, groups within one session first. Two
/// groups are joined at the relative pose that most links between them support; paths through a
/// third group count as links. A wrong link therefore determines a pose only if it is the only
/// link. If one link contradicts another, there is no majority, and the groups stay apart. Then
/// solves a robust pose graph of all consistent links (Cauchy loss, errors weighted by the links'
/// covariances). Disagreeing links and the nodes that only they connect are removed, and the pose
/// graph is solved again. The order of nodes and links affects only the choice of the frame, unless
/// two nodes have equal radii.
///
/// @param graph   node poses are ignored; links without covariance are not used
/// @param extents one per node
/// @throws Error (misuse) for invalid options or extents, (input) for an invalid graph
OptimisedPoses optimise_poses(const PoseGraph& graph, std::span<const NodeExtent> extents,
                              const PoseOptimisationOptions& options = {});

/// Updates the poses of a graph after nodes and links were added, without a new vote on the links
/// used before.
///
/// New nodes are placed by the votes of their links, as in optimise_poses(). The pose graph of all
/// used links is then solved from the previous poses, in few iterations. All covariances follow
/// from the used links.
///
/// Unlike optimise_poses(), this function keeps previously used links unless new links contradict
/// them. A wrong majority is therefore not reconsidered. If both functions use the same links,
/// poses and covariances are the same.
///
/// If the frame would change, or the new links split the group, the function calls
/// optimise_poses().
///
/// @param before result before the additions, extended to one entry per present node and link: no
///        pose for new nodes, `false` for new links; the tree is ignored
/// @throws Error (misuse) for invalid options or extents or a missing entry, (input) for an invalid
///        graph
OptimisedPoses update_poses(const PoseGraph& graph, std::span<const NodeExtent> extents,
                            const OptimisedPoses& before,
                            const PoseOptimisationOptions& options = {});

/// Poses of all linked nodes, group by group: the largest group, then the largest of the remaining
/// groups, and so on.
struct OptimisedComponents {
  /// Reference of each node: the first node of its group, which defines the frame of the pose.
  /// std::nullopt for a node without a pose.
  std::vector<std::optional<std::size_t>> frames;
  std::vector<Similarity3> frame_from_node;  ///< one per node
  std::vector<Matrix7d> covariances;         ///< as in OptimisedPoses
  /// Per link: whether it agrees with the poses of two nodes of one group. std::nullopt if a node
  /// has no pose.
  std::vector<std::optional<bool>> agrees;
};

/// @param before poses of the largest group before nodes and links were added, as for
///        update_poses(); null: all poses are new
/// @throws Error as optimise_poses() and update_poses()
OptimisedComponents optimise_components(const PoseGraph& graph, std::span<const NodeExtent> extents,
                                        const OptimisedPoses* before = nullptr,
                                        const PoseOptimisationOptions& options = {});

/// Covariances of the poses stored in the graph, relative to its first node, from its links; see
/// OptimisedPoses.
/// @throws Error (input) if the links do not determine all poses, or as optimise_poses()
std::vector<Matrix7d> covariances_of_poses(const PoseGraph& graph,
                                           std::span<const NodeExtent> extents);

}  // namespace cairn
