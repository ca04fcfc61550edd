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

/// What alignment says of a pose.
enum class Verdict {
  kAligned,    ///< its probability suffices, and the matches determine it
  kAmbiguous,  ///< the evidence suffices for a match, but not for one pose
  kRejected,   ///< no pose is probable enough
};

/// "aligned", "ambiguous" or "rejected": the names in results.
std::string_view to_string(Verdict verdict);

using LinkId = StrongId<struct LinkIdTag, std::uint64_t>;

/// The relation of two nodes: a transform that was stated or judged, x_in_target = target_from_source * x_in_source, or
/// the finding that there is none.
struct Link {
  LinkId id = {};  ///< in an atlas, from 1 and never reused; 0 elsewhere
  NodeId target = {};
  NodeId source = {};
  LinkKind kind = LinkKind::kPlacement;
  std::optional<Verdict> verdict = {};  ///< std::nullopt for a stated link, which was not judged
  std::optional<double> probability =
      {};                   ///< that the transform is right; std::nullopt if not judged
  std::string reason = {};  ///< one sentence for people
  /// Whether both maps contain the same images, or are one map, so that the link is no independent evidence; the reason
  /// says which. Known where the maps were just aligned; neither files nor an atlas keep it.
  bool repeats = false;
  /// Only if the link is stated or its verdict is aligned.
  std::optional<Similarity3> target_from_source = {};
  /// Left perturbation in the target's frame, (δt, δφ); std::nullopt if unknown.
  std::optional<Matrix6d> covariance = {};
  /// The same with the scale, (δt, δφ, δ log s), for a link that measures it.
  std::optional<Matrix7d> covariance_with_scale = {};

  /// Whether it may place a node: it has a transform, which is stated or judged aligned.
  bool connects() const;
  /// "stated", or the name of the verdict.
  std::string_view status() const;
  /// The covariance of seven numbers; those of the scale are 0 if the link does not measure it.
  std::optional<Matrix7d> full_covariance() const;
};

/// Nodes and links that connect them.
struct PoseGraph {
  std::vector<PoseNode> nodes;
  std::vector<Link> links;

  /// @throws Error (input) naming the node or link: a duplicate id, a link of a node with itself or a
  ///        missing one, a link that does not connect, a number that is not finite, a covariance that is not symmetric or has a negative
  ///        eigenvalue, a probability outside [0, 1]
  /// @param where for the messages, e.g. the file's name
  void validate(std::string_view where = "pose graph") const;
};

}  // namespace cairn
