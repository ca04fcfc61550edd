// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "cairn/alignment/alignment.hpp"
#include "cairn/core/ids.hpp"
#include "cairn/geometry/similarity3.hpp"
#include "cairn/map/landmark_map.hpp"
#include "cairn/merging/linking/link_maps.hpp"
#include "cairn/merging/optimisation/optimise_poses.hpp"
#include "cairn/pose_graph/pose_graph.hpp"

namespace cairn {

/// Commits are numbered from 1 without gaps; 0 is the empty atlas.
using CommitId = StrongId<struct CommitIdTag, std::uint64_t>;
using AtlasLinkId = StrongId<struct AtlasLinkIdTag, std::uint64_t>;

/// A map in the atlas. Its data are stored once, under the hash of their bytes, and never change.
struct AtlasNode {
  NodeId id;            ///< from 1; never reused
  std::string name;     ///< unique among the present nodes
  std::string session;  ///< shared by maps of one run; empty if unknown
  std::string map;      ///< hash of its .cairn bytes, 32 hexadecimal digits
  LengthUnit length_unit = LengthUnit::kMetres;
  std::uint64_t frames = 0;
  std::uint64_t landmarks = 0;
  std::uint64_t observations = 0;
  NodeExtent extent;
};

/// The result of aligning two maps, or a statement about them. Never changes.
struct AtlasLink {
  AtlasLinkId id;  ///< from 1; never reused
  NodeId target;
  NodeId source;
  LinkKind kind = LinkKind::kPlacement;
  std::optional<Verdict> verdict;     ///< std::nullopt for a stated link, which was not judged
  std::optional<double> probability;  ///< that the transform is right; std::nullopt if not judged
  std::string reason;                 ///< one sentence for people
  /// Only if the link is stated or its verdict is aligned.
  std::optional<Similarity3> target_from_source;
  /// Left perturbation in the target's frame, (δt, δφ).
  std::optional<Matrix6d> covariance;
  /// The same with the scale, for a link that measures it.
  std::optional<Matrix7d> covariance_with_scale;

  /// Whether it may place a map.
  bool connects() const { return cairn::connects(verdict, target_from_source); }
};

/// Pose of a map in its component.
struct AtlasPose {
  NodeId node;
  NodeId frame;  ///< the node whose frame its component uses
  Similarity3 frame_from_node;
  Matrix7d covariance = Matrix7d::Zero();  ///< left perturbation in the frame, (δt, δφ, δ log s)
};

/// Equality up to rounding.
bool operator==(const AtlasPose& a, const AtlasPose& b);

/// Content of an atlas after a commit.
struct AtlasState {
  CommitId commit;
  std::map<NodeId, AtlasNode> nodes;
  std::map<AtlasLinkId, AtlasLink> links;
  std::map<NodeId, AtlasPose> poses;
  /// For aligned links: whether they agree with the poses; without links added since the last optimisation.
  std::map<AtlasLinkId, bool> agrees;

  /// Null if there is none of that name.
  const AtlasNode* find(const std::string& name) const;
};

/// Changes of a commit. Nodes and links with id 0 are new; with another id, removed ones are restored.
/// Removing a node does not remove its links and poses.
struct AtlasChanges {
  std::string text;                ///< description for people
  std::optional<CommitId> undoes;  ///< last commit of the command that they undo
  std::vector<AtlasNode> nodes;
  std::vector<AtlasLink> links;
  std::vector<AtlasPose> poses;  ///< each replaces the node's pose
  std::vector<std::pair<AtlasLinkId, bool>> agrees;
  std::vector<NodeId> removed_nodes;
  std::vector<AtlasLinkId> removed_links;
  std::vector<NodeId> removed_poses;
  std::vector<AtlasLinkId> removed_agrees;

  bool empty() const {
    return nodes.empty() && links.empty() && poses.empty() && agrees.empty() &&
           removed_nodes.empty() && removed_links.empty() && removed_poses.empty() &&
           removed_agrees.empty();
  }
};

/// A line of the log.
struct AtlasCommit {
  CommitId id;
  std::int64_t time_ms = 0;  ///< since 1970, UTC
  std::string author;
  std::string host;
  std::string verb;  ///< "add" etc.
  std::string text;
  std::optional<CommitId> undoes;  ///< last commit of the run that this one undid
  CommitId run;                    ///< first commit of the command that it belongs to
};

/// Objects that commits changed.
struct AtlasTouched {
  std::vector<NodeId> nodes;
  std::vector<AtlasLinkId> links;
  std::vector<NodeId> poses;
  std::vector<AtlasLinkId> agrees;
};

}  // namespace cairn
