// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/atlas/detail/change_log.hpp"

#include <set>

#include <fmt/format.h>

#include "cairn/atlas/detail/row_bytes.hpp"

namespace cairn {
namespace {

constexpr const char* kSound =
    "a sound atlas; 'cairn atlas salvage' takes what is sound into a new one";

std::map<std::uint64_t, std::uint64_t>* values_of(RowValues& values, std::int64_t kind) {
  switch (kind) {
    case kNode:
      return &values.nodes;
    case kLink:
      return &values.links;
    case kPose:
      return &values.poses;
    case kAgrees:
      return &values.agrees;
    default:
      return nullptr;
  }
}

}  // namespace

bool RowValues::apply(const RowChange& change) {
  auto* const values = values_of(*this, change.kind);
  if (values == nullptr) return false;
  if (change.value) {
    (*values)[change.object] = *change.value;
  } else {
    values->erase(change.object);
  }
  return true;
}

std::string commit_digest(const AtlasCommit& commit, std::span<const RowChange> changes) {
  RowBytes row;
  row.add(commit.id.value).add(static_cast<std::uint64_t>(commit.time_ms));
  row.add(commit.author).add(commit.host).add(commit.verb).add(commit.text);
  row.add(commit.undoes ? std::optional(commit.undoes->value) : std::nullopt);
  row.add(commit.run.value);
  for (const RowChange& change : changes) {
    row.add(static_cast<std::uint64_t>(change.kind)).add(change.object).add(change.value);
  }
  return row.digest();
}

void apply(const AtlasChanges& changes, AtlasState& state) {
  for (const NodeId id : changes.removed_nodes) state.nodes.erase(id);
  for (const LinkId id : changes.removed_links) state.links.erase(id);
  for (const NodeId id : changes.removed_poses) state.poses.erase(id);
  for (const LinkId id : changes.removed_agrees) state.agrees.erase(id);
  for (const AtlasNode& node : changes.nodes) state.nodes[node.id] = node;
  for (const Link& link : changes.links) state.links[link.id] = link;
  for (const AtlasPose& pose : changes.poses) state.poses[pose.node] = pose;
  for (const auto& [id, agrees] : changes.agrees) state.agrees[id] = agrees;
}

void check_state(const AtlasState& state, const std::string& name, ErrorKind kind) {
  const auto refuse = [&](const std::string& what, const std::string& expected) {
    if (kind == ErrorKind::kInput) throw Error(kind, name, "damaged: " + what, kSound);
    throw Error(kind, name, what, expected);
  };
  std::set<std::string> names;
  for (const auto& [id, node] : state.nodes) {
    if (node.name.empty()) refuse(fmt::format("map {} has no name", id.value), "a name");
    if (!names.insert(node.name).second) {
      refuse(fmt::format("two maps called {}", printable(node.name)), "another name");
    }
  }
  for (const auto& [id, link] : state.links) {
    if (link.target == link.source) refuse("a link of a map with itself", "two maps");
    for (const NodeId end : {link.target, link.source}) {
      if (state.nodes.contains(end)) continue;
      refuse(fmt::format("link {} is of map {}, which is not there", id.value, end.value),
             "both maps of every link");
    }
  }
  for (const auto& [id, pose] : state.poses) {
    if (state.nodes.contains(id) && state.nodes.contains(pose.frame)) continue;
    refuse(fmt::format("the pose of map {} is of a map or in the frame of one that is not there",
                       id.value),
           "both maps");
  }
  for (const auto& [id, pose] : state.poses) {
    const auto of_frame = state.poses.find(pose.frame);
    if (of_frame != state.poses.end() && of_frame->second.frame == pose.frame) continue;
    refuse(fmt::format("the pose of map {} is in the frame of map {}, which has no pose in it",
                       id.value, pose.frame.value),
           "a pose of that map in its own frame");
  }
  for (const auto& [id, agrees] : state.agrees) {
    if (!state.links.contains(id)) refuse("agreement of a link that is not there", "the link");
  }
}

bool has_poses_of(const AtlasState& state, LinkId link, bool agrees) {
  const auto found = state.links.find(link);
  if (found == state.links.end()) return false;
  const auto target = state.poses.find(found->second.target);
  const auto source = state.poses.find(found->second.source);
  return target != state.poses.end() && source != state.poses.end() &&
         (!agrees || target->second.frame == source->second.frame);
}

void check_agreements(const AtlasState& before, const AtlasState& after, const std::string& name) {
  for (const auto& [id, agrees] : after.agrees) {
    if (has_poses_of(after, id, agrees)) continue;
    // Atlases of earlier versions hold such agreements.
    const auto old = before.agrees.find(id);
    if (old != before.agrees.end() && !has_poses_of(before, id, old->second)) continue;
    throw Error(
        ErrorKind::kMisuse, name,
        fmt::format("link {} would be left without the poses that it was compared with", id.value),
        "poses of both its maps; to undo the later commands first");
  }
}

const AtlasNode& require_node(const AtlasState& state, NodeId id) {
  const auto found = state.nodes.find(id);
  if (found != state.nodes.end()) return found->second;
  throw Error(ErrorKind::kMisuse, "node", fmt::format("{} is not there", id.value),
              "a map of the atlas");
}

std::string plural(std::size_t count, std::string_view noun) {
  return fmt::format("{} {}{}", count, noun, count == 1 ? "" : "s");
}

void fail_as_damaged(const std::string& name, std::string_view what) {
  throw Error(ErrorKind::kInput, name, fmt::format("{} is damaged", what), kSound);
}

}  // namespace cairn
