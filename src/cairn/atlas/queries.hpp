// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "cairn/atlas/atlas.hpp"
#include "cairn/merging/changes.hpp"

/// Questions to an atlas: routes between its maps, what changed between two states or sessions, and all of it as one map.
namespace cairn {

/// A chain of links from one map to another.
struct AtlasRoute {
  std::vector<NodeId> nodes;       ///< from the target to the source
  std::vector<LinkId> links;       ///< one fewer than nodes
  Similarity3 target_from_source;  ///< along the links
  /// Left perturbation in the target's frame, (δt, δφ, δ log s), to first order, for independent errors of
  /// the links. std::nullopt if a link has no covariance.
  std::optional<Matrix7d> covariance;
  /// By the optimised poses, which use all links; std::nullopt unless both maps are in one frame.
  std::optional<Similarity3> optimised;
};

/// The most certain chain of aligned links that agree with the poses: the least sum of the links'
/// variances.
/// @return std::nullopt if no chain connects the maps
std::optional<AtlasRoute> find_route(const AtlasState& state, NodeId target, NodeId source);

/// A map whose pose changed.
struct MovedNode {
  NodeId node;
  double shift = 0.0;  ///< of the centre of its landmarks, in the unit of its frame
  double turn_rad = 0.0;
  bool frame_changed = false;  ///< if true, the two numbers are 0
};

/// Difference between two states.
struct AtlasDifference {
  std::vector<NodeId> added_nodes, removed_nodes;
  std::vector<LinkId> added_links, removed_links;
  std::vector<NodeId> placed, no_longer_placed;
  std::vector<MovedNode> moved;
  std::vector<LinkId> now_contradicted, no_longer_contradicted;

  bool empty() const;
};

AtlasDifference difference(const AtlasState& before, const AtlasState& after);

/// Maps of a session that have a pose.
std::vector<NodeId> placed_of_session(const AtlasState& state, const std::string& session);

/// find_changes() between two sets of maps of an atlas, each fused first. The result is in the frame of
/// their group; its landmarks are those of the fused maps.
/// @throws Error (misuse) if a set is empty, a map is in both, or one has no pose in the common frame
ChangeResult world_difference(Atlas& atlas, const AtlasState& state,
                              const std::vector<NodeId>& first, const std::vector<NodeId>& second,
                              const ChangeOptions& options = {}, const Execution& execution = {});

/// The largest group of placed maps of an atlas as one map, for reading: Atlas::merge(), or the map of an atlas of one.
///
/// Beside an atlas in a file that this user may change, the merged map is kept in merged_world_file(). It holds a hash
/// of the maps, links and poses that it was made of, of the seed and of Cairn's version, and is used only while these
/// are the atlas's. AtlasStore::compact() removes it.
LandmarkMap merged_world(Atlas& atlas, const AtlasState& state, const Execution& execution = {});

}  // namespace cairn
