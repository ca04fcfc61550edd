// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/atlas/atlas.hpp"

#include <algorithm>
#include <list>
#include <map>
#include <set>
#include <string_view>
#include <tuple>
#include <utility>

#include <fmt/format.h>

#include "cairn/atlas/detail/change_log.hpp"
#include "cairn/atlas/store/open_store.hpp"
#include "cairn/core/detail/disjoint_sets.hpp"
#include "cairn/core/error.hpp"
#include "cairn/core/file.hpp"
#include "cairn/formats/map_file.hpp"
#include "cairn/map/operations.hpp"
#include "cairn/pose_graph/optimise_poses.hpp"

namespace cairn {
namespace {

std::string bytes_of(const LandmarkMap& map) {
  std::string bytes;
  write_binary(map, [&](std::string_view more) { bytes += more; });
  return bytes;
}

AtlasNode described(const LandmarkMap& map) {
  AtlasNode node;
  node.length_unit = map.info().length_unit;
  node.frames = map.frame_count();
  node.landmarks = map.landmark_count();
  node.observations = map.observation_count();
  node.extent = node_extent(map.landmarks().positions);
  return node;
}

}  // namespace

void Atlas::create(const std::string& location, const AtlasStoreOptions& options) {
  create_store(location, options);
}

Atlas Atlas::open(const std::string& location, const AtlasStoreOptions& options) {
  return Atlas(open_store(location, options));
}

AtlasCommitted Atlas::commit(const std::string& verb, const AtlasStore::Make& make) {
  AtlasCommitted committed = store_->commit({.verb = verb, .run = run_}, make);
  if (run_.value == 0 && committed.is_new) run_ = committed.commit;
  return committed;
}

LandmarkMap Atlas::map(const AtlasNode& node) {
  const std::string bytes = store_->map_bytes(node.map);
  MemoryReader reader(bytes, fmt::format("{}: {}", store_->name(), node.name));
  return read_binary(reader);
}

Atlas::Added Atlas::add(const LandmarkMap& map, const std::string& name,
                        const std::string& session) {
  reject_if(map.landmark_count() == 0, name, "holds no landmarks", "a map with landmarks");
  const std::string bytes = bytes_of(map);
  AtlasNode node = described(map);
  node.name = name;
  node.session = session;
  Added added;
  const AtlasCommitted committed = commit("add", [&](const AtlasState& now) {
    AtlasChanges changes;
    node.map = store_->put_map(bytes);
    for (const auto& [id, other] : now.nodes) {
      if (other.map == node.map) {
        added = {id, true};
        return changes;
      }
    }
    refuse_if(now.find(name) != nullptr, store_->name(),
              fmt::format("another map is called {}", printable(name)), "another name");
    changes.text = fmt::format("{}: {}, {}", name, plural(node.landmarks, "landmark"),
                               plural(node.frames, "keyframe"));
    changes.nodes.push_back(node);
    return changes;
  });
  if (!added.was_there) added.node = committed.nodes.front();
  return added;
}

PoseGraph pose_graph(const AtlasState& state) {
  PoseGraph graph;
  for (const auto& [id, node] : state.nodes) {
    const auto pose = state.poses.find(id);
    graph.nodes.push_back(
        {id, node.name, node.session,
         pose == state.poses.end() ? Similarity3() : pose->second.frame_from_node});
  }
  for (const auto& [id, link] : state.links) {
    if (link.connects()) graph.links.push_back(link);
  }
  // Sorted, so that the order in which the pairs were tried has no effect.
  std::stable_sort(graph.links.begin(), graph.links.end(), [](const Link& a, const Link& b) {
    return std::tuple(a.source, a.target) < std::tuple(b.source, b.target);
  });
  return graph;
}

AtlasOptimised Atlas::optimize(const PoseOptimisationOptions& options) {
  return optimize(options, Scope::kAll);
}

AtlasOptimised Atlas::update_poses(const PoseOptimisationOptions& options) {
  return optimize(options, Scope::kAdded);
}

AtlasOptimised Atlas::optimize(const PoseOptimisationOptions& options, Scope scope) {
  options.validate();
  // Another process may add links meanwhile.
  for (int attempt = 0; attempt < 10; ++attempt) {
    if (const auto result = optimize_once(options, scope)) return *result;
  }
  throw Error(ErrorKind::kStorage, store_->name(), "is being changed by another process",
              "to be tried again later");
}

bool Atlas::has_only_grown(const AtlasState& state) {
  const std::vector<AtlasCommit> log = store_->log();
  const auto last = std::find_if(log.rbegin(), log.rend(), [](const AtlasCommit& commit) {
    return commit.verb == "optimize";
  });
  if (last == log.rend()) return false;
  const AtlasState before = store_->state(last->id);
  return before.poses == state.poses &&
         std::all_of(before.agrees.begin(), before.agrees.end(),
                     [&](const auto& link) { return state.links.contains(link.first); });
}

namespace {

// What is known of the largest component, for update_poses(). No poses if there is no component.
OptimisedPoses poses_before(const AtlasState& state, const PoseGraph& graph) {
  OptimisedPoses known;
  std::set<NodeId> placed;
  const std::vector<AtlasComponent> components = components_of(state);
  if (!components.empty()) {
    placed.insert(components.front().nodes.begin(), components.front().nodes.end());
  }
  for (const PoseNode& node : graph.nodes) {
    const bool is_placed = placed.contains(node.id);
    known.world_from_node.push_back(
        is_placed ? std::optional(state.poses.at(node.id).frame_from_node) : std::nullopt);
    known.covariances.push_back(is_placed ? state.poses.at(node.id).covariance : Matrix7d::Zero());
  }
  for (const Link& link : graph.links) {
    const auto agree = state.agrees.find(link.id);
    known.agrees.push_back(agree != state.agrees.end() && agree->second &&
                           placed.contains(link.target));
  }
  return known;
}

// Changes from the poses of an atlas to others.
AtlasChanges changes_of(const AtlasState& now, const std::map<NodeId, AtlasPose>& poses,
                        const std::map<LinkId, bool>& agrees) {
  AtlasChanges changes;
  std::set<NodeId> frames;
  for (const auto& [id, pose] : poses) {
    const auto old = now.poses.find(id);
    if (old == now.poses.end() || !(old->second == pose)) changes.poses.push_back(pose);
    frames.insert(pose.frame);
  }
  for (const auto& [id, pose] : now.poses) {
    if (!poses.contains(id)) changes.removed_poses.push_back(id);
  }
  for (const auto& [id, agree] : agrees) {
    const auto old = now.agrees.find(id);
    if (old == now.agrees.end() || old->second != agree) changes.agrees.emplace_back(id, agree);
  }
  for (const auto& [id, agree] : now.agrees) {
    if (!agrees.contains(id)) changes.removed_agrees.push_back(id);
  }
  changes.text = fmt::format("{} of {} placed in {}", poses.size(), plural(now.nodes.size(), "map"),
                             plural(frames.size(), "frame"));
  return changes;
}

}  // namespace

std::optional<AtlasOptimised> Atlas::optimize_once(const PoseOptimisationOptions& options,
                                                   Scope scope) {
  const AtlasState state = store_->state();
  const PoseGraph graph = pose_graph(state);
  std::vector<NodeExtent> extents;
  for (const PoseNode& node : graph.nodes) extents.push_back(state.nodes.at(node.id).extent);
  OptimisedPoses before;
  if (scope == Scope::kAdded && has_only_grown(state)) before = poses_before(state, graph);
  const bool grown = std::any_of(before.world_from_node.begin(), before.world_from_node.end(),
                                 [](const auto& pose) { return pose.has_value(); });
  const OptimisedComponents found =
      optimise_components(graph, extents, grown ? &before : nullptr, options);
  std::map<NodeId, AtlasPose> poses;
  for (std::size_t i = 0; i < graph.nodes.size(); ++i) {
    if (!found.frames[i]) continue;
    const NodeId id = graph.nodes[i].id;
    poses[id] = {id, graph.nodes[*found.frames[i]].id, found.frame_from_node[i],
                 found.covariances[i]};
  }
  std::map<LinkId, bool> agrees;
  for (std::size_t i = 0; i < graph.links.size(); ++i) {
    if (found.agrees[i]) agrees[graph.links[i].id] = *found.agrees[i];
  }

  AtlasOptimised result;
  result.placed = poses.size();
  bool outdated = false;
  const AtlasCommitted committed = commit("optimize", [&](const AtlasState& now) {
    outdated = now.commit != state.commit;
    if (outdated) return AtlasChanges();
    AtlasChanges changes = changes_of(now, poses, agrees);
    result.changed = !changes.empty();
    return changes;
  });
  if (outdated) return std::nullopt;
  result.commit = committed.commit;
  for (const auto& [id, agree] : agrees) result.contradicted += agree ? 0 : 1;
  return result;
}

std::vector<AtlasComponent> components_of(const AtlasState& state) {
  std::map<NodeId, std::vector<NodeId>> by_frame;
  for (const auto& [id, pose] : state.poses) by_frame[pose.frame].push_back(id);
  std::vector<AtlasComponent> components;
  for (auto& [frame, nodes] : by_frame) {
    // remove() may leave the pose of one.
    if (nodes.size() > 1) components.push_back({frame, std::move(nodes)});
  }
  std::stable_sort(components.begin(), components.end(),
                   [](const auto& a, const auto& b) { return a.nodes.size() > b.nodes.size(); });
  return components;
}

bool is_used(const AtlasState& state, const Link& link) {
  const auto agrees = state.agrees.find(link.id);
  return link.connects() && agrees != state.agrees.end() && agrees->second &&
         has_poses_of(state, link.id, true);
}

namespace {

// unlink() and remove() leave poses that only the removed links determined.
void require_links(const AtlasState& state, const AtlasComponent& component,
                   const std::string& name) {
  const std::vector<NodeId>& nodes = component.nodes;
  const auto index_of = [&](NodeId id) {
    return static_cast<std::size_t>(std::lower_bound(nodes.begin(), nodes.end(), id) -
                                    nodes.begin());
  };
  detail::DisjointSets linked(nodes.size());
  for (const auto& [id, link] : state.links) {
    if (!is_used(state, link) || state.poses.at(link.target).frame != component.frame) continue;
    linked.join(index_of(link.target), index_of(link.source));
  }
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    if (linked.first_of(i) == 0) continue;
    throw Error(ErrorKind::kMisuse, name,
                fmt::format("the links that connected {} with {} were removed",
                            state.nodes.at(nodes[i]).name, state.nodes.at(nodes[0]).name),
                "poses of the links that are left: run optimize ('cairn atlas optimize')");
  }
}

}  // namespace

AtlasComponent component_with(const AtlasState& state, std::optional<NodeId> node,
                              const std::string& name) {
  const std::vector<AtlasComponent> components = components_of(state);
  refuse_if(!node && components.empty(), name, "no two maps are in one frame",
            "maps that 'link' linked and 'optimize' placed");
  auto chosen = components.begin();
  if (node) {
    const AtlasNode& wanted = require_node(state, *node);
    chosen = std::ranges::find_if(components, [&](const AtlasComponent& component) {
      return std::ranges::binary_search(component.nodes, wanted.id);
    });
    refuse_if(chosen == components.end(), name,
              fmt::format("{} has no pose in a frame with other maps", wanted.name),
              "a map that 'optimize' placed");
  }
  require_links(state, *chosen, name);
  return *chosen;
}

MergeResult Atlas::merge(const FusionOptions& options, std::optional<NodeId> frame,
                         std::optional<CommitId> at, const Execution& execution) {
  const AtlasState state = store_->state(at);
  const AtlasComponent chosen = component_with(state, frame, store_->name());
  std::map<NodeId, NodeId> index_of;
  std::list<LandmarkMap> maps;
  std::vector<MergeInput> inputs;
  MergeResult result;
  for (const auto& [id, node] : state.nodes) {
    index_of[id] = NodeId{inputs.size()};
    MergeInput& input = inputs.emplace_back(MergeInput{node.name, nullptr, node.session});
    MergedMap& merged = result.maps.emplace_back();
    const auto pose = state.poses.find(id);
    if (pose == state.poses.end()) {
      merged.reason = "it has no pose: no aligned link places it, or optimize() has not seen it";
    } else if (pose->second.frame != chosen.frame) {
      merged.reason = fmt::format("it is placed in another frame, that of {}",
                                  state.nodes.at(pose->second.frame).name);
    } else {
      merged.placed = true;
      merged.world_from_map = pose->second.frame_from_node;
      merged.covariance = pose->second.covariance;
      input.map = &maps.emplace_back(map(node));
    }
  }
  for (const auto& [id, link] : state.links) {
    Link& held = result.links.emplace_back(link);
    held.target = index_of.at(link.target);
    held.source = index_of.at(link.source);
    result.used.push_back(is_used(state, link));
  }
  fuse_placed(inputs, options, result, execution);
  return result;
}

namespace {

// Removes everything that refers to a map.
void remove_with_links(const AtlasState& now, NodeId node, AtlasChanges& changes) {
  std::set<NodeId> unplaced = {node};
  for (const auto& [id, pose] : now.poses) {
    if (id != node && pose.frame != node) continue;
    changes.removed_poses.push_back(id);
    unplaced.insert(id);
  }
  for (const auto& [id, link] : now.links) {
    if (link.target == node || link.source == node) changes.removed_links.push_back(id);
    const bool is_unplaced = unplaced.contains(link.target) || unplaced.contains(link.source);
    if (is_unplaced && now.agrees.contains(id)) changes.removed_agrees.push_back(id);
  }
  changes.removed_nodes.push_back(node);
}

}  // namespace

void Atlas::remove(NodeId node) {
  commit("remove", [&](const AtlasState& now) {
    AtlasChanges changes;
    const std::string& name = require_node(now, node).name;
    remove_with_links(now, node, changes);
    changes.text = fmt::format("{} and {}", name, plural(changes.removed_links.size(), "link"));
    return changes;
  });
}

std::vector<NodeId> Atlas::split(NodeId node, std::size_t frames) {
  if (frames < 1) throw Error(ErrorKind::kMisuse, "frames", "0", "at least 1");
  const AtlasNode whole = require_node(store_->state(), node);
  const LandmarkMap original = map(whole);
  std::vector<FrameId> ids = original.frames().ids;
  std::sort(ids.begin(), ids.end());
  refuse_if(ids.size() <= frames, "frames", fmt::format("{}", frames),
            fmt::format("fewer than the {} keyframes of {}", ids.size(), whole.name));
  std::vector<AtlasNode> parts;
  std::vector<std::string> bytes;  // of each part
  for (std::size_t begin = 0; begin < ids.size(); begin += frames) {
    const std::size_t end = std::min(begin + frames, ids.size());
    const FrameId behind = end < ids.size() ? ids[end] : FrameId{ids.back().value + 1};
    const LandmarkMap part = cut_frames(original, ids[begin], behind);
    if (part.landmark_count() == 0) continue;
    AtlasNode described_part = described(part);
    described_part.name = fmt::format("{}/{}", whole.name, parts.size() + 1);
    described_part.session = whole.session.empty() ? whole.name : whole.session;
    bytes.push_back(bytes_of(part));
    parts.push_back(std::move(described_part));
  }
  reject_if(parts.size() < 2, whole.name, "no two parts of it have landmarks of their own",
            "more keyframes a part");
  const AtlasCommitted committed = commit("split", [&](const AtlasState& now) {
    require_node(now, node);
    AtlasChanges changes;
    remove_with_links(now, node, changes);
    for (std::size_t i = 0; i < parts.size(); ++i) parts[i].map = store_->put_map(bytes[i]);
    changes.nodes = parts;
    changes.text = fmt::format("{} into {}", whole.name, plural(parts.size(), "map"));
    return changes;
  });
  // Links between parts are the map's relative poses, with a standard deviation of a hundredth of their size.
  commit("split", [&](const AtlasState& now) {
    AtlasChanges changes;
    for (std::size_t i = 1; i < committed.nodes.size(); ++i) {
      Link link;
      link.target = committed.nodes[i - 1];
      link.source = committed.nodes[i];
      if (!now.nodes.contains(link.target) || !now.nodes.contains(link.source)) continue;
      link.kind = LinkKind::kOdometry;
      link.reason = "neighbours in the map that was split";
      link.target_from_source = Similarity3();
      const double length = 0.01 * parts[i].extent.radius;
      Matrix6d covariance = Matrix6d::Zero();
      covariance.diagonal() << Eigen::Vector3d::Constant(length * length),
          Eigen::Vector3d::Constant(1e-4);
      link.covariance = covariance;
      changes.links.push_back(std::move(link));
    }
    changes.text = fmt::format("{} linked as neighbours", plural(changes.links.size() + 1, "part"));
    return changes;
  });
  return committed.nodes;
}

}  // namespace cairn
