// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "cairn/core/execution.hpp"
#include "cairn/pose_graph/pose_graph.hpp"

namespace cairn {

/// Where a node's landmarks are, in its own frame: what a pose is compared by.
struct NodeExtent {
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  double radius = 1.0;  ///< root mean square distance from the centre; positive
};

/// How poses of nodes are found from the links between them.
struct PoseOptimisationOptions {
  /// Two poses of a node agree if they move its landmarks apart by less than this share of its radius (root
  /// mean square); in (0, 1].
  double agreement = 0.1;
  int max_iterations = 100;  ///< of the solver
  Execution execution = {};  ///< one thread: so results do not depend on how many there are

  /// @throws Error (misuse) naming the field, its value and what it may be
  void validate() const;
};

struct OptimisedPoses {
  /// One a node, in the frame of the first node of the largest group that links join, which is the identity;
  /// of several groups that are as large, the one with the first node. std::nullopt for other nodes.
  std::vector<std::optional<Similarity3>> world_from_node;
  /// Left perturbation in the world, (δt, δφ, δ log s); zero of the first node. Beside the poses.
  std::vector<Matrix7d> covariances;
  /// By link: whether it is in the component and agrees with its poses; what disagrees was left out.
  std::vector<bool> agrees;
  /// Links by which each node can be reached from the first one, the most certain first; indices.
  std::vector<std::size_t> tree;
};

/// Poses in one frame.
///
/// Start: groups of nodes grow together, those of one session first. Two groups become one if more links between
/// them agree on how they lie than on anything else; what links say by way of a third group counts too. So a wrong
/// link decides only where no other speaks, and groups stay apart where one link stands against another.
/// Then a robust pose graph (Cauchy loss), whose errors are weighed by the links' covariances, of all links
/// that can be true. Links that disagree with its poses are left out, and so are nodes that nothing else
/// connects; then it is solved again.
///
/// @param graph   its poses are not looked at; a link without covariance is not used
/// @param extents one a node
/// @throws Error (misuse) for invalid options or extents, (input) for an invalid graph
OptimisedPoses optimise_poses(const PoseGraph& graph, std::span<const NodeExtent> extents,
                              const PoseOptimisationOptions& options = {});

}  // namespace cairn
