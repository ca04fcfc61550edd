// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <deque>
#include <optional>

#include <fmt/format.h>

#include "cairn/atlas/queries.hpp"
#include "cairn/core/error.hpp"
#include "cairn/merging/fusion/fuse_maps.hpp"

namespace cairn {
namespace {

// The maps as one; `kept` keeps what the result refers to.
PlacedMap as_one(Atlas& atlas, const AtlasState& state, const std::vector<NodeId>& nodes,
                 const Execution& execution, std::deque<LandmarkMap>& kept) {
  std::vector<PlacedMap> placed;
  for (const NodeId id : nodes) {
    const AtlasNode& node = state.nodes.at(id);
    kept.push_back(atlas.map(node));
    const AtlasPose& pose = state.poses.at(id);
    placed.push_back({&kept.back(), node.name, pose.frame_from_node, pose.covariance});
  }
  if (placed.size() == 1) return placed.front();
  kept.push_back(fuse_maps(placed, {}, execution).map);
  return {&kept.back(), "", Similarity3(), Matrix7d::Zero()};
}

}  // namespace

std::vector<NodeId> placed_of_session(const AtlasState& state, const std::string& session) {
  std::vector<NodeId> nodes;
  for (const auto& [id, node] : state.nodes) {
    if (node.session == session && state.poses.contains(id)) nodes.push_back(id);
  }
  return nodes;
}

ChangeResult world_difference(Atlas& atlas, const AtlasState& state,
                              const std::vector<NodeId>& first, const std::vector<NodeId>& second,
                              const ChangeOptions& options, const Execution& execution) {
  std::optional<NodeId> frame;
  for (const auto* const nodes : {&first, &second}) {
    refuse_if(nodes->empty(), atlas.store().name(), "no maps to compare",
              "at least one on each side");
    for (const NodeId id : *nodes) {
      const auto pose = state.poses.find(id);
      const std::string& name = state.nodes.at(id).name;
      refuse_if(pose == state.poses.end(), atlas.store().name(),
                fmt::format("{} has no pose", name), "maps that 'optimize' placed");
      refuse_if(frame && pose->second.frame != *frame, atlas.store().name(),
                fmt::format("{} is not in the frame of the others", name),
                "maps that links connect");
      frame = pose->second.frame;
    }
  }
  for (const NodeId id : first) {
    if (std::find(second.begin(), second.end(), id) == second.end()) continue;
    throw Error(ErrorKind::kMisuse, atlas.store().name(),
                fmt::format("{} is on both sides", state.nodes.at(id).name), "two different sides");
  }
  std::deque<LandmarkMap> kept;
  const PlacedMap before = as_one(atlas, state, first, execution, kept);
  const PlacedMap after = as_one(atlas, state, second, execution, kept);
  return find_changes(before, after, options, execution);
}

}  // namespace cairn
