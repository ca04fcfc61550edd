// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "cairn/core/ids.hpp"
#include "cairn/geometry/similarity3.hpp"

namespace cairn {

/// Identifies a node across files and programs; arbitrary, unique in its graph.
using NodeId = StrongId<struct NodeIdTag, std::uint64_t>;

/// A map or a keyframe, with its own frame.
struct PoseNode {
  NodeId id;
  std::string name;             ///< e.g. the map's file; empty if unknown
  std::string session;          ///< shared by nodes of one run; empty if unknown
  Similarity3 world_from_node;  ///< x_in_world = world_from_node * x_in_node
};

/// Origin of a link's transform.
enum class LinkKind {
  kOdometry,   ///< neighbours in one run
  kPlacement,  ///< an alignment that was judged
  kManual,     ///< stated by a person
};

/// "odometry" etc.: the names in files.
std::string_view to_string(LinkKind kind);

/// A measured transform between two nodes: x_in_target = target_from_source * x_in_source.
struct PoseLink {
  NodeId target;
  NodeId source;
  Similarity3 target_from_source;
  /// Left perturbation in the target's frame, (δt, δφ); std::nullopt if unknown.
  std::optional<Matrix6d> covariance;
  /// The same with the scale, (δt, δφ, δ log s), for a link that measures it.
  std::optional<Matrix7d> covariance_with_scale;
  LinkKind kind = LinkKind::kOdometry;
  /// Probability that the link is right; std::nullopt if not judged.
  std::optional<double> probability;
};

/// Nodes and measured transforms between them.
struct PoseGraph {
  std::vector<PoseNode> nodes;
  std::vector<PoseLink> links;

  /// @throws Error (input) naming the node or link: a duplicate id, a link of a node with itself or a
  ///        missing one, a number that is not finite, a covariance that is not symmetric or has a negative
  ///        eigenvalue, a probability outside [0, 1]
  /// @param where for the messages, e.g. the file's name
  void validate(std::string_view where = "pose graph") const;
};

}  // namespace cairn
