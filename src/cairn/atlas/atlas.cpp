// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/atlas/atlas.hpp"

#include <algorithm>
#include <chrono>
#include <list>
#include <map>
#include <ranges>
#include <set>
#include <span>
#include <string_view>
#include <tuple>
#include <utility>

#include <fmt/format.h>

#include "cairn/atlas/detail/change_log.hpp"
#include "cairn/atlas/store/open_store.hpp"
#include "cairn/core/error.hpp"
#include "cairn/core/file.hpp"
#include "cairn/formats/map_file.hpp"
#include "cairn/map/operations.hpp"
#include "cairn/pose_graph/optimise_poses.hpp"

namespace cairn {
namespace {

std::string plural(std::size_t count, std::string_view noun) {
  return fmt::format("{} {}{}", count, noun, count == 1 ? "" : "s");
}

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

const AtlasNode& require_node(const AtlasState& state, NodeId id) {
  const auto found = state.nodes.find(id);
  if (found != state.nodes.end()) return found->second;
  throw Error(ErrorKind::kMisuse, "node", fmt::format("{} is not there", id.value),
              "a map of the atlas");
}

NodePair pair_of(NodeId a, NodeId b) {
  return a < b ? NodePair(a, b) : NodePair(b, a);
}

// The maps of an atlas by index, ascending by their ids. Those that are removed meanwhile keep their index.
class AtlasMaps : public MapStore {
 public:
  AtlasMaps(Atlas& atlas, const AtlasState& state) : atlas_(atlas) { add_new(state); }

  // Ids are never reused, so new maps come last.
  void add_new(const AtlasState& state) {
    const auto first =
        nodes_.empty() ? state.nodes.begin() : state.nodes.upper_bound(nodes_.back().id);
    for (auto one = first; one != state.nodes.end(); ++one) nodes_.push_back(one->second);
  }

  std::size_t size() const override { return nodes_.size(); }
  std::string session(std::size_t map) const override { return nodes_[map].session; }
  std::size_t landmark_count(std::size_t map) const override { return nodes_[map].landmarks; }
  std::shared_ptr<const LandmarkMap> load(std::size_t map) override {
    return std::make_shared<const LandmarkMap>(atlas_.map(nodes_[map]));
  }
  std::size_t capacity() const override { return 64; }

  NodeId id(std::size_t map) const { return nodes_[map].id; }
  NodePair ids(const IndexPair& pair) const { return {id(pair.first), id(pair.second)}; }
  std::size_t index(NodeId id) const {
    const auto found = std::partition_point(nodes_.begin(), nodes_.end(),
                                            [&](const AtlasNode& node) { return node.id < id; });
    return static_cast<std::size_t>(found - nodes_.begin());
  }

 private:
  Atlas& atlas_;
  std::vector<AtlasNode> nodes_;
};

}  // namespace

void AtlasLinkOptions::validate() const {
  links.validate();
  if (shards < 1 || shard >= shards) {
    throw Error(ErrorKind::kMisuse, "AtlasLinkOptions.shard",
                fmt::format("{} of {}", shard, shards), "a number below that of the shards");
  }
}

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
  if (map.landmark_count() == 0) {
    throw Error(ErrorKind::kInput, name, "holds no landmarks", "a map with landmarks");
  }
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
    if (now.find(name) != nullptr) {
      throw Error(ErrorKind::kMisuse, store_->name(),
                  fmt::format("another map is called {}", printable(name)), "another name");
    }
    changes.text = fmt::format("{}: {}, {}", name, plural(node.landmarks, "landmark"),
                               plural(node.frames, "keyframe"));
    changes.nodes.push_back(node);
    return changes;
  });
  if (!added.was_there) added.node = committed.nodes.front();
  return added;
}

namespace {

// Earlier results of pairs, which decide whether they are tried.
struct KnownPairs {
  KnownPairs(const AtlasState& state, bool retry) {
    for (const auto& [id, link] : state.links) {
      // Pairs linked by odometry are tried too, because an alignment is more accurate.
      if (link.kind == LinkKind::kOdometry) continue;
      const bool again =
          retry && link.kind == LinkKind::kPlacement && link.verdict != Verdict::kAligned;
      const NodePair pair = pair_of(link.target, link.source);
      if (again) {
        replaced[pair].push_back(id);
      } else {
        known.insert(pair);
      }
    }
  }

  std::set<NodePair> known;                          // will not be tried
  std::map<NodePair, std::vector<LinkId>> replaced;  // links that a new result replaces
};

LinkOptions without_progress(LinkOptions options) {
  options.execution = options.execution.without_progress();
  return options;
}

// Aligns pairs and stores the results.
class Linker {
 public:
  using Commit = std::function<AtlasCommitted(const AtlasStore::Make& make)>;

  Linker(AtlasMaps& maps, const AtlasLinkOptions& options, Commit commit, AtlasLinkResult& result)
      : maps_(maps),
        options_(options),
        commit_(std::move(commit)),
        result_(result),
        linker_(maps, without_progress(options.links)) {}

  /// @param expected total number of pairs, for the progress
  void align(std::span<const NodePair> pairs, const AtlasState& state, const KnownPairs& known,
             std::size_t expected) {
    maps_.add_new(state);
    std::vector<IndexPair> indices;
    for (const NodePair& pair : pairs) {
      indices.emplace_back(maps_.index(pair.first), maps_.index(pair.second));
    }
    const auto take = [&](Link link) {
      link.target = maps_.id(link.target.value);
      link.source = maps_.id(link.source.value);
      pending_.push_back(std::move(link));
      // Commits every few seconds: the log stays short, and little is lost if the process is killed.
      if (std::chrono::steady_clock::now() - last_flush_ > std::chrono::seconds(2)) {
        flush(state, known);
      }
      ++done_;
      if (options_.links.execution.progress) {
        options_.links.execution.progress(
            std::min(1.0, static_cast<double>(done_) / static_cast<double>(expected)));
      }
    };
    try {
      linker_.link(indices, take);
    } catch (...) {
      flush(state, known);  // keeps the results so far
      throw;
    }
    flush(state, known);
  }

 private:
  void flush(const AtlasState& state, const KnownPairs& known) {
    if (pending_.empty()) return;
    std::vector<Link> kept;
    commit_([&](const AtlasState& now) {
      AtlasChanges changes;
      kept.clear();
      std::set<NodePair> done;  // by another process meanwhile
      for (const auto& [id, link] : now.links) {
        if (link.kind == LinkKind::kOdometry || state.links.contains(id)) continue;
        done.insert(pair_of(link.target, link.source));
      }
      // Not only by its id: versions that compacted otherwise may have given it to another map.
      const auto is_there = [&](NodeId id) {
        const auto node = now.nodes.find(id);
        return node != now.nodes.end() && node->second.map == state.nodes.at(id).map;
      };
      std::size_t aligned = 0;
      for (const Link& link : pending_) {
        const NodePair pair = pair_of(link.target, link.source);
        if (!is_there(pair.first) || !is_there(pair.second) || done.contains(pair)) continue;
        const auto replaced = known.replaced.find(pair);
        if (replaced != known.replaced.end()) {
          for (const LinkId old : replaced->second) {
            if (!now.links.contains(old)) continue;
            changes.removed_links.push_back(old);
            if (now.agrees.contains(old)) changes.removed_agrees.push_back(old);
          }
        }
        changes.links.push_back(link);
        kept.push_back(link);
        if (link.connects()) ++aligned;
      }
      changes.text =
          fmt::format("{} tried, {} aligned", plural(changes.links.size(), "pair"), aligned);
      return changes;
    });
    for (const Link& link : kept) {
      ++result_.tried;
      if (link.connects()) ++result_.aligned;
      if (options_.on_link) options_.on_link(link, state);
    }
    pending_.clear();
    last_flush_ = std::chrono::steady_clock::now();
  }

  AtlasMaps& maps_;
  const AtlasLinkOptions& options_;
  Commit commit_;
  AtlasLinkResult& result_;
  PairLinker linker_;  // keeps prepared maps from batch to batch
  std::vector<Link> pending_;
  std::chrono::steady_clock::time_point last_flush_ = std::chrono::steady_clock::now();
  std::size_t done_ = 0;
};

}  // namespace

AtlasLinkResult Atlas::link(const AtlasLinkOptions& options) {
  options.validate();
  AtlasState state = store_->state();
  AtlasLinkResult result;
  KnownPairs known(state, options.retry);
  const std::set<NodeId> only(options.only.begin(), options.only.end());
  for (const NodeId id : only) require_node(state, id);
  AtlasMaps maps(*this, state);
  const std::vector<IndexPair> likely = pairs_to_link(maps, options.links);
  auto next = likely.begin();  // in the order of all pairs
  std::vector<NodePair> pairs;
  std::size_t number = 0;
  for (std::size_t source = 0; source < maps.size(); ++source) {
    for (std::size_t target = 0; target < source; ++target) {
      const bool is_likely = next != likely.end() && *next == IndexPair(target, source);
      if (is_likely) ++next;
      const NodePair pair = maps.ids({target, source});
      if (!only.empty() && !only.contains(pair.first) && !only.contains(pair.second)) continue;
      ++result.pairs;
      if (number++ % options.shards != options.shard) continue;
      if (known.known.contains(pair)) {
        ++result.tried_before;
      } else if (!is_likely) {
        ++result.not_likely;
      } else {
        pairs.push_back(pair);
      }
    }
  }

  Linker linker(
      maps, options, [this](const AtlasStore::Make& make) { return commit("link", make); }, result);
  const std::unique_ptr<AtlasPairQueue> queue = store_->share(pairs);
  if (queue == nullptr) {
    linker.align(pairs, state, known, pairs.size());
    return result;
  }
  // A few at a time, so that all processes end at about the same time.
  const std::size_t batch = 2 * std::size_t{options.links.execution.executor.threads()};
  for (std::vector<NodePair> taken = queue->take(batch); !taken.empty();
       taken = queue->take(batch)) {
    // Others may have added maps, and links, since.
    state = store_->state();
    known = KnownPairs(state, options.retry);
    std::erase_if(taken, [&](const NodePair& pair) {
      return !state.nodes.contains(pair.first) || !state.nodes.contains(pair.second) ||
             known.known.contains(pair);
    });
    linker.align(taken, state, known, pairs.size());
    queue->done();
  }
  return result;
}

std::size_t Atlas::link_by_odometry(std::span<const Link> links) {
  const AtlasCommitted committed = commit("link", [&](const AtlasState& now) {
    std::set<NodePair> known;
    for (const auto& [id, link] : now.links) {
      if (link.kind == LinkKind::kOdometry) known.insert(pair_of(link.target, link.source));
    }
    AtlasChanges changes;
    for (const Link& stated : links) {
      require_node(now, stated.target);
      require_node(now, stated.source);
      if (!known.insert(pair_of(stated.target, stated.source)).second) continue;
      Link& odometry = changes.links.emplace_back(stated);
      odometry.id = {};
      odometry.kind = LinkKind::kOdometry;
      odometry.verdict.reset();
      odometry.probability.reset();
      odometry.reason = "stated by odometry";
    }
    if (changes.links.empty()) return changes;
    changes.text = fmt::format("{} of odometry", plural(changes.links.size(), "link"));
    return changes;
  });
  return committed.links.size();
}

LinkId Atlas::link_manually(NodeId target, NodeId source, const Similarity3& target_from_source,
                            const Matrix7d& covariance, const std::string& reason) {
  const AtlasCommitted committed = commit("link", [&](const AtlasState& now) {
    Link link;
    link.target = target;
    link.source = source;
    link.kind = LinkKind::kManual;
    link.reason = reason.empty() ? "stated by a person" : reason;
    link.target_from_source = target_from_source;
    if (covariance(6, 6) > 0.0) {
      link.covariance_with_scale = covariance;
    } else {
      link.covariance = covariance.topLeftCorner<6, 6>();
    }
    AtlasChanges changes;
    changes.text = fmt::format("{} <- {} by hand", require_node(now, target).name,
                               require_node(now, source).name);
    // Replaces an earlier statement by a person.
    for (const auto& [id, old] : now.links) {
      if (old.kind != LinkKind::kManual ||
          pair_of(old.target, old.source) != pair_of(target, source)) {
        continue;
      }
      changes.removed_links.push_back(id);
      if (now.agrees.contains(id)) changes.removed_agrees.push_back(id);
    }
    changes.links.push_back(link);
    return changes;
  });
  return committed.links.front();
}

void Atlas::unlink(NodeId a, NodeId b, const std::string& reason) {
  commit("unlink", [&](const AtlasState& now) {
    AtlasChanges changes;
    const std::string names =
        fmt::format("{} and {}", require_node(now, a).name, require_node(now, b).name);
    for (const auto& [id, link] : now.links) {
      if (pair_of(link.target, link.source) != pair_of(a, b)) continue;
      changes.removed_links.push_back(id);
      if (now.agrees.contains(id)) changes.removed_agrees.push_back(id);
    }
    if (changes.removed_links.empty()) {
      throw Error(ErrorKind::kMisuse, store_->name(), "no link between " + names,
                  "two linked maps");
    }
    Link link;
    std::tie(link.target, link.source) = pair_of(a, b);
    link.kind = LinkKind::kManual;
    link.verdict = Verdict::kRejected;
    link.reason = reason.empty() ? "unlinked by a person" : reason;
    changes.links.push_back(link);
    changes.text = names;
    return changes;
  });
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
  for (auto& [frame, nodes] : by_frame) components.push_back({frame, std::move(nodes)});
  std::stable_sort(components.begin(), components.end(),
                   [](const auto& a, const auto& b) { return a.nodes.size() > b.nodes.size(); });
  return components;
}

AtlasComponent component_with(const AtlasState& state, std::optional<NodeId> node,
                              const std::string& name) {
  const std::vector<AtlasComponent> components = components_of(state);
  if (node) {
    const AtlasNode& wanted = require_node(state, *node);
    const auto pose = state.poses.find(wanted.id);
    for (const AtlasComponent& component : components) {
      if (pose != state.poses.end() && component.frame == pose->second.frame) return component;
    }
    throw Error(ErrorKind::kMisuse, name, fmt::format("{} has no pose", wanted.name),
                "a map that 'optimize' placed");
  }
  if (components.empty()) {
    throw Error(ErrorKind::kMisuse, name, "no two maps are in one frame",
                "maps that 'link' linked and 'optimize' placed");
  }
  return components.front();
}

bool is_used(const AtlasState& state, const Link& link) {
  const auto agrees = state.agrees.find(link.id);
  return link.connects() && agrees != state.agrees.end() && agrees->second &&
         has_poses_of(state, link.id, true);
}

MergeResult Atlas::merge(const MergePlacedOptions& options, std::optional<NodeId> frame,
                         std::optional<CommitId> at) {
  const AtlasState state = store_->state(at);
  const AtlasComponent chosen = component_with(state, frame, store_->name());
  const AtlasMaps all(*this, state);
  std::list<LandmarkMap> maps;
  std::vector<MergeInput> inputs;
  MergeResult result;
  for (const auto& [id, node] : state.nodes) {
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
    held.target = NodeId{all.index(link.target)};
    held.source = NodeId{all.index(link.source)};
    result.used.push_back(is_used(state, link));
  }
  fuse_placed(inputs, options, result);
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
  if (ids.size() <= frames) {
    throw Error(ErrorKind::kMisuse, "frames", fmt::format("{}", frames),
                fmt::format("fewer than the {} keyframes of {}", ids.size(), whole.name));
  }
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
  if (parts.size() < 2) {
    throw Error(ErrorKind::kInput, whole.name, "no two parts of it have landmarks of their own",
                "more keyframes a part");
  }
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

namespace {

// Restores an object's earlier value, unless it was changed since.
template <class Id, class Value, class Equal, class Restore, class Remove>
void set_back(Id id, const std::map<Id, Value>& before, const std::map<Id, Value>& after,
              const std::map<Id, Value>& now, const Equal& equal, const Restore& restore,
              const Remove& remove, const std::string& name, const std::string& what) {
  const auto then = before.find(id);
  const auto left = after.find(id);
  const auto here = now.find(id);
  const bool same = (left == after.end()) == (here == now.end()) &&
                    (left == after.end() || equal(left->second, here->second));
  if (!same) {
    throw Error(ErrorKind::kMisuse, name, fmt::format("{} was changed again since", what),
                "to undo the later commands first");
  }
  const bool changed = (then == before.end()) != (left == after.end()) ||
                       (then != before.end() && !equal(then->second, left->second));
  if (!changed) return;
  if (then == before.end()) {
    remove(id);
  } else {
    restore(then->second);
  }
}

struct Command {
  AtlasCommit chosen;
  std::vector<CommitId> commits;  // ascending
};

// The command of a commit; std::nullopt: the last one that is not undone.
Command command_to_undo(const std::vector<AtlasCommit>& log, std::optional<CommitId> commit_id,
                        const std::string& name) {
  std::map<CommitId, CommitId> runs;  // by commit
  for (const AtlasCommit& commit : log) runs[commit.id] = commit.run;
  std::set<CommitId> undone;  // runs
  for (const AtlasCommit& commit : std::ranges::reverse_view(log)) {
    // Ignores an undo that was itself undone, and what was undone before the log starts.
    if (!commit.undoes || undone.contains(commit.run)) continue;
    const auto run = runs.find(*commit.undoes);
    if (run != runs.end()) undone.insert(run->second);
  }
  const auto chosen = std::find_if(log.rbegin(), log.rend(), [&](const AtlasCommit& commit) {
    return commit_id ? commit.id == *commit_id : !commit.undoes && !undone.contains(commit.run);
  });
  if (chosen == log.rend()) {
    throw Error(ErrorKind::kMisuse, name,
                commit_id ? fmt::format("no commit {}", commit_id->value) : "nothing to undo",
                "a commit of its log");
  }
  Command command{*chosen, {}};
  for (const AtlasCommit& commit : log) {
    if (commit.run == chosen->run) command.commits.push_back(commit.id);
  }
  const CommitId first = command.commits.front();
  const CommitId last = command.commits.back();
  if (undone.contains(chosen->run)) {
    throw Error(ErrorKind::kMisuse, name, fmt::format("commit {} is undone already", last.value),
                "another commit");
  }
  // A run has the id of its first commit.
  if (first != chosen->run || (first == log.front().id && first.value > 1)) {
    throw Error(ErrorKind::kMisuse, name,
                fmt::format("what was before commit {} is compacted", first.value),
                "a later commit");
  }
  return command;
}

AtlasChanges undoing(const Command& command, AtlasStore& store, const AtlasState& now) {
  const std::vector<CommitId>& commits = command.commits;
  const AtlasTouched touched = store.touched(commits);
  const AtlasState before = store.state(CommitId{commits.front().value - 1});
  const AtlasState after = store.state(commits.back());
  AtlasChanges changes;
  changes.undoes = commits.back();
  changes.text = commits.size() == 1 ? fmt::format("commit {}: {} {}", command.chosen.id.value,
                                                   command.chosen.verb, command.chosen.text)
                                     : fmt::format("commits {} to {}: {}", commits.front().value,
                                                   commits.back().value, command.chosen.verb);
  const std::string& name = store.name();
  const auto same_node = [](const AtlasNode&, const AtlasNode&) { return true; };
  const auto same_link = [](const Link&, const Link&) { return true; };
  for (const NodeId id : touched.nodes) {
    set_back(
        id, before.nodes, after.nodes, now.nodes, same_node,
        [&](const AtlasNode& node) { changes.nodes.push_back(node); },
        [&](NodeId removed) { changes.removed_nodes.push_back(removed); }, name,
        fmt::format("map {}", id.value));
  }
  for (const LinkId id : touched.links) {
    set_back(
        id, before.links, after.links, now.links, same_link,
        [&](const Link& link) { changes.links.push_back(link); },
        [&](LinkId removed) { changes.removed_links.push_back(removed); }, name,
        fmt::format("link {}", id.value));
  }
  for (const NodeId id : touched.poses) {
    set_back(
        id, before.poses, after.poses, now.poses,
        [](const AtlasPose& a, const AtlasPose& b) { return a == b; },
        [&](const AtlasPose& pose) { changes.poses.push_back(pose); },
        [&](NodeId removed) { changes.removed_poses.push_back(removed); }, name,
        fmt::format("the pose of map {}", id.value));
  }
  for (const LinkId id : touched.agrees) {
    set_back(
        id, before.agrees, after.agrees, now.agrees, [](bool a, bool b) { return a == b; },
        [&](bool agrees) { changes.agrees.emplace_back(id, agrees); },
        [&](LinkId removed) { changes.removed_agrees.push_back(removed); }, name,
        fmt::format("the agreement of link {}", id.value));
  }
  return changes;
}

}  // namespace

CommitId Atlas::undo(std::optional<CommitId> commit_id) {
  begin_run();
  CommitId undone;
  // Reads the log and the earlier states within the commit, so that no other process drops rows that it restores.
  commit("undo", [&](const AtlasState& now) {
    const Command command = command_to_undo(store_->log(), commit_id, store_->name());
    undone = command.commits.back();
    return undoing(command, *store_, now);
  });
  return undone;
}

}  // namespace cairn
