// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "cairn/core/option_table.hpp"
#include "cairn/pose_graph/pose_graph.hpp"

namespace cairn {

/// Extent of a node's landmarks in its own frame, by which poses are compared.
struct NodeExtent {
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  double radius = 1.0;  ///< median distance from the centre; positive
};

/// Centre and radius by medians, robust to outliers.
/// @param landmarks of the node, in its frame
NodeExtent node_extent(std::span<const Eigen::Vector3d> landmarks);

/// Options of optimise_poses().
struct PoseOptimisationOptions {
  /// Two poses of a node agree if they move its landmarks apart by less than this share of its radius: the root of the
  /// sum of the squares of the shift of its centre in radii, of the rotation in radians, and of the difference of the
  /// logarithms of scale; in (0, 1].
  double agreement = 0.1;
  int max_iterations = 100;  ///< of the solver

  static const OptionTable table;
  /// @throws Error (misuse) naming the field, its value and the constraint
  void validate() const;
};

struct OptimisedPoses {
  /// One per node, in the frame of the first node of the largest linked group, whose pose is the identity;
  /// of equally large groups, the one with the first node. std::nullopt for other nodes.
  std::vector<std::optional<Similarity3>> world_from_node;
  /// Left perturbation in the world, (δt, δφ, δ log s); zero for the first node. One per node.
  std::vector<Matrix7d> covariances;
  /// Per link: whether it is in the group and agrees with the poses. Links that disagree were not used.
  std::vector<bool> agrees;
  /// Spanning tree of the most certain links, in the order in which they reach nodes from the first one.
  std::vector<std::size_t> tree;
};

/// Computes poses in one frame.
///
/// Initial poses: groups of nodes grow together, those of one session first. Two groups are joined at the relative pose
/// that more of the links between them support than any other; links by way of a third group count too. So a wrong link
/// determines the pose only if it is the only link. If one link contradicts another, there is no majority, and the
/// groups stay apart. Then solves a robust pose graph (Cauchy loss, errors weighted by the links' covariances) of all
/// consistent links. Links that disagree with the result are removed, together with nodes that only such links connect;
/// then it is solved again. The order of nodes and links affects only the choice of the frame, unless two nodes have
/// equal radii.
///
/// @param graph   its poses are ignored; links without covariance are not used
/// @param extents one per node
/// @throws Error (misuse) for invalid options or extents, (input) for an invalid graph
OptimisedPoses optimise_poses(const PoseGraph& graph, std::span<const NodeExtent> extents,
                              const PoseOptimisationOptions& options = {});

/// Updates the poses of a graph to which nodes and links were added, without voting anew on the links used before.
///
/// New nodes join the placed ones by the votes of their links, as in optimise_poses(). All used links are then
/// optimised from the poses before, which takes few iterations, and all covariances are those of the used links.
///
/// Differs from optimise_poses() in that links that were used before stay unless the new ones contradict them; a
/// wrong majority is therefore not reconsidered. If both use the same links, poses and covariances are the same.
///
/// If the frame would change, or the new links break the group apart, the result is that of optimise_poses().
///
/// @param before of the graph before the additions, but with an entry per present node and link: no pose for
///        new nodes, `false` for new links; its tree is ignored
/// @throws Error (misuse) for invalid options or extents or an entry missing, (input) for an invalid graph
OptimisedPoses update_poses(const PoseGraph& graph, std::span<const NodeExtent> extents,
                            const OptimisedPoses& before,
                            const PoseOptimisationOptions& options = {});

/// Poses of all linked nodes: those of the largest group, then of the largest of what is left, and so on.
struct OptimisedComponents {
  /// Reference of each node: the first node of its group, in whose frame the pose is. std::nullopt for a node without a
  /// pose.
  std::vector<std::optional<std::size_t>> frames;
  std::vector<Similarity3> frame_from_node;  ///< one per node
  std::vector<Matrix7d> covariances;         ///< as in OptimisedPoses
  /// Per link between nodes with poses: whether it is of one group and agrees with the poses.
  std::vector<std::optional<bool>> agrees;
};

/// @param before of the largest group before nodes and links were added, as for update_poses(); null: all poses are new
/// @throws Error as optimise_poses() and update_poses()
OptimisedComponents optimise_components(const PoseGraph& graph, std::span<const NodeExtent> extents,
                                        const OptimisedPoses* before = nullptr,
                                        const PoseOptimisationOptions& options = {});

/// Covariances of the graph's own poses relative to its first node, as its links determine them; see OptimisedPoses.
/// @throws Error (input) if the links do not determine all poses, or as optimise_poses()
std::vector<Matrix7d> covariances_of_poses(const PoseGraph& graph,
                                           std::span<const NodeExtent> extents);

}  // namespace cairn
