// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <span>
#include <utility>
#include <vector>

#include "cairn/pose_graph/optimise_poses.hpp"

namespace cairn::detail {

/// Placeholder for an index that does not exist.
inline constexpr std::size_t kNoIndex = static_cast<std::size_t>(-1);

/// A link of a pose graph with node indices and a positive definite covariance.
struct PoseEdge {
  std::size_t link = 0;  ///< index in the graph
  std::size_t target = 0;
  std::size_t source = 0;
  Similarity3 target_from_source;
  Matrix7d covariance;
};

/// @throws Error (misuse) unless there is one valid extent per node, (input) for an invalid graph
void check_graph(const PoseGraph& graph, std::span<const NodeExtent> extents);

/// Positions of each link's target and source among the nodes of a valid graph.
std::vector<std::pair<std::size_t, std::size_t>> link_ends(const PoseGraph& graph);

/// The graph's links that have a covariance, which is bounded from below so that it can be inverted.
/// @throws Error as check_graph()
std::vector<PoseEdge> pose_edges(const PoseGraph& graph, std::span<const NodeExtent> extents);

/// Number of each node's session, equal for the nodes of one session; a node without a session has a number of its own.
std::vector<std::size_t> session_numbers(const PoseGraph& graph);

/// How far apart two poses move the node's landmarks: root of the sum of the squares of the shift of the centre in radii,
/// of the rotation in radians and of the difference of the logarithms of scale.
double disagreement(const Similarity3& a, const Similarity3& b, const NodeExtent& extent);

/// Mean square shift of the centre of a node's landmarks under the covariance of the node's pose, in the unit of the
/// frame that the pose leads to. The node's origin can be far away and move much farther.
double mean_square_shift(const Matrix7d& covariance, const Similarity3& pose,
                         const NodeExtent& extent);

/// Mean square of disagreement() under the covariance of a node's pose.
double mean_square_disagreement(const Matrix7d& covariance, const Similarity3& pose,
                                const NodeExtent& extent);

/// The same under the covariance of an edge.
double mean_square_disagreement(const PoseEdge& edge, std::span<const NodeExtent> extents);

/// Whether an edge agrees with the poses of its nodes, or may agree after their optimisation. The covariances of the
/// edge and of the poses enlarge the tolerance `agreement`.
/// @param variance mean square disagreement under the poses' covariances
bool can_agree(const PoseEdge& edge, const Similarity3& target, const Similarity3& source,
               double variance, std::span<const NodeExtent> extents, double agreement);

/// Links of the tree that grows from `root` to each node that the edges reach, by the most certain edge first.
std::vector<std::size_t> most_certain_tree(std::size_t root, std::span<const PoseEdge> edges,
                                           std::span<const NodeExtent> extents);

}  // namespace cairn::detail
