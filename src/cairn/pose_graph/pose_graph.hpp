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
  std::string session;          ///< name that nodes of one run share; empty if unknown
  Similarity3 world_from_node;  ///< x_in_world = world_from_node * x_in_node
};

/// Origin of a link's transform.
enum class LinkKind {
  kOdometry,   ///< neighbours in one run
  kPlacement,  ///< a judged alignment
  kManual,     ///< stated by a person
};

/// "odometry" etc.: the names in files.
std::string_view to_string(LinkKind kind);

/// Verdict of an alignment on a pose.
enum class Verdict {
  kAligned,    ///< the pose is probable enough and determined by the matches
  kAmbiguous,  ///< the maps probably match, but not at a single pose
  kRejected,   ///< no pose is probable enough
};

/// "aligned", "ambiguous" or "rejected": the names in results.
std::string_view to_string(Verdict verdict);

using LinkId = StrongId<struct LinkIdTag, std::uint64_t>;

/// Relation of two nodes: a stated or judged transform, or a judged pair without a transform.
/// x_in_target = target_from_source * x_in_source.
struct Link {
  LinkId id = {};  ///< in an atlas, from 1 and never reused; 0 elsewhere
  NodeId target = {};
  NodeId source = {};
  LinkKind kind = LinkKind::kPlacement;
  std::optional<Verdict> verdict = {};  ///< std::nullopt for a stated link, which was not judged
  std::optional<double> probability =
      {};                   ///< that the transform is right; std::nullopt if not judged
  std::string reason = {};  ///< one sentence for people
  /// Whether both maps share images or are one map, so that the link is not independent evidence;
  /// `reason` states which. Only an alignment sets this flag; files and atlases do not store it.
  bool repeats = false;
  /// std::nullopt unless the link is stated or its verdict is aligned.
  std::optional<Similarity3> target_from_source = {};
  /// Left perturbation in the target's frame, (δt, δφ); std::nullopt if unknown.
  std::optional<Matrix6d> covariance = {};
  /// The same with the scale, (δt, δφ, δ log s), for a link that measures the scale.
  std::optional<Matrix7d> covariance_with_scale = {};

  /// Whether the link may place a node: its transform is stated or its verdict is aligned.
  bool connects() const;
  /// "stated", or the name of the verdict.
  std::string_view status() const;
  /// 7x7 covariance of (δt, δφ, δ log s); row and column of the scale are 0 if the link does not
  /// measure it.
  std::optional<Matrix7d> full_covariance() const;
};

/// Nodes and links that connect them.
struct PoseGraph {
  std::vector<PoseNode> nodes;
  std::vector<Link> links;

  /// @throws Error (input) naming the node or link, for a duplicate id, a link of a node with
  ///        itself or with a missing node, a link without a trusted transform, a number that is not
  ///        finite, a covariance that is not symmetric or has a negative eigenvalue, or a
  ///        probability outside [0, 1]
  /// @param where prefix of the messages, e.g. the file's name
  void validate(std::string_view where = "pose graph") const;
};

}  // namespace cairn
