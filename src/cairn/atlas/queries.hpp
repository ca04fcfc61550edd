// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "cairn/atlas/atlas.hpp"
#include "cairn/merging/changes.hpp"

/// Queries of an atlas: routes between maps, changes between states or sessions, and the merged
/// map.
namespace cairn {

/// A chain of links from one map to another.
struct AtlasRoute {
  std::vector<NodeId> nodes;       ///< from the target to the source
  std::vector<LinkId> links;       ///< one fewer than nodes
  Similarity3 target_from_source;  ///< along the links
  /// Left perturbation in the target's frame, (δt, δφ, δ log s), to first order, for independent errors of
  /// the links. std::nullopt if a link has no covariance.
  std::optional<Matrix7d> covariance;
  /// target_from_source by the optimised poses, which depend on all links, not only on the route's.
  /// std::nullopt unless both maps have poses in one frame.
  std::optional<Similarity3> optimised;
};

/// Finds the most certain chain of aligned links that do not contradict the poses: the chain with
/// the least sum of the links' variances.
/// @return std::nullopt if no chain connects the maps
std::optional<AtlasRoute> find_route(const AtlasState& state, NodeId target, NodeId source);

/// A map whose pose changed.
struct MovedNode {
  NodeId node;
  double shift = 0.0;  ///< displacement of its landmarks' centre, frame's unit
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

/// find_changes() between two sets of maps of an atlas, each fused to one map first. The result is
/// in the frame of their component; its landmarks belong to the fused maps.
/// @throws Error (misuse) if a set is empty, a map is in both, or one has no pose in the common frame
ChangeResult world_difference(Atlas& atlas, const AtlasState& state,
                              const std::vector<NodeId>& first, const std::vector<NodeId>& second,
                              const ChangeOptions& options = {}, const Execution& execution = {});

/// The merged map of the largest component, from Atlas::merge(); an atlas with one map gives that
/// map.
///
/// If the atlas is a writable file, the merged map is cached in merged_world_file(). The cache
/// holds a hash of the maps, links, poses, seed and Cairn's version, and is used only if the hash
/// matches the atlas. AtlasStore::compact() removes the cache.
LandmarkMap merged_world(Atlas& atlas, const AtlasState& state, const Execution& execution = {});

}  // namespace cairn
