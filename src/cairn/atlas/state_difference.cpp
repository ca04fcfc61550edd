// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/atlas/queries.hpp"

namespace cairn {
namespace {

template <class Id, class Value>
void compare_keys(const std::map<Id, Value>& before, const std::map<Id, Value>& after,
                  std::vector<Id>& added, std::vector<Id>& removed) {
  for (const auto& [id, value] : after) {
    if (!before.contains(id)) added.push_back(id);
  }
  for (const auto& [id, value] : before) {
    if (!after.contains(id)) removed.push_back(id);
  }
}

bool is_contradicted(const AtlasState& state, LinkId link) {
  const auto agrees = state.agrees.find(link);
  return agrees != state.agrees.end() && !agrees->second;
}

}  // namespace

bool AtlasDifference::empty() const {
  return added_nodes.empty() && removed_nodes.empty() && added_links.empty() &&
         removed_links.empty() && placed.empty() && no_longer_placed.empty() && moved.empty() &&
         now_contradicted.empty() && no_longer_contradicted.empty();
}

AtlasDifference difference(const AtlasState& before, const AtlasState& after) {
  AtlasDifference result;
  compare_keys(before.nodes, after.nodes, result.added_nodes, result.removed_nodes);
  compare_keys(before.links, after.links, result.added_links, result.removed_links);
  compare_keys(before.poses, after.poses, result.placed, result.no_longer_placed);
  for (const auto& [id, pose] : after.poses) {
    const auto old = before.poses.find(id);
    const auto node = after.nodes.find(id);
    if (old == before.poses.end() || old->second == pose || node == after.nodes.end()) continue;
    MovedNode moved{.node = id};
    moved.frame_changed = old->second.frame != pose.frame;
    if (!moved.frame_changed) {
      const Eigen::Vector3d& centre = node->second.extent.centre;
      moved.shift = (pose.frame_from_node * centre - old->second.frame_from_node * centre).norm();
      moved.turn_rad =
          (old->second.frame_from_node.rigid().inverse() * pose.frame_from_node.rigid()).angle();
    }
    result.moved.push_back(moved);
  }
  for (const auto& [id, link] : after.links) {
    const bool now = is_contradicted(after, id);
    const bool then = is_contradicted(before, id);
    if (now && !then) result.now_contradicted.push_back(id);
    if (then && !now) result.no_longer_contradicted.push_back(id);
  }
  return result;
}

}  // namespace cairn
