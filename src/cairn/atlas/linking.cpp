// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <chrono>
#include <functional>
#include <map>
#include <memory>
#include <set>
#include <span>
#include <tuple>
#include <utility>

#include <fmt/format.h>

#include "cairn/atlas/atlas.hpp"
#include "cairn/atlas/detail/change_log.hpp"
#include "cairn/core/error.hpp"

// Links between the maps of an atlas: by alignment, by odometry, and by people.
namespace cairn {
namespace {

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

// Aligns pairs and stores the results.
class Linker {
 public:
  using Commit = std::function<AtlasCommitted(const AtlasStore::Make& make)>;

  Linker(AtlasMaps& maps, const AtlasLinkOptions& options, const Execution& execution,
         Commit commit, AtlasLinkResult& result)
      : maps_(maps),
        options_(options),
        execution_(execution),
        commit_(std::move(commit)),
        result_(result),
        linker_(maps, options.links, execution.without_progress()) {}

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
      if (execution_.progress) {
        execution_.progress(
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
      // Of the command so far, so that its last commit tells what the command did.
      changes.text =
          fmt::format("{} tried, {} aligned", plural(result_.tried + changes.links.size(), "pair"),
                      result_.aligned + aligned);
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
  const Execution& execution_;
  Commit commit_;
  AtlasLinkResult& result_;
  PairLinker linker_;  // keeps prepared maps from batch to batch
  std::vector<Link> pending_;
  std::chrono::steady_clock::time_point last_flush_ = std::chrono::steady_clock::now();
  std::size_t done_ = 0;
};

}  // namespace

void AtlasLinkOptions::validate() const {
  links.validate();
  refuse_if(shards < 1 || shard >= shards, "AtlasLinkOptions.shard",
            fmt::format("{} of {}", shard, shards), "a number below that of the shards");
}

AtlasLinkResult Atlas::link(const AtlasLinkOptions& options, const Execution& execution) {
  options.validate();
  AtlasState state = store_->state();
  AtlasLinkResult result;
  KnownPairs known(state, options.retry);
  const std::set<NodeId> only(options.only.begin(), options.only.end());
  for (const NodeId id : only) require_node(state, id);
  AtlasMaps maps(*this, state);
  const std::vector<IndexPair> likely = pairs_to_link(maps, options.links, execution);
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
      maps, options, execution,
      [this](const AtlasStore::Make& make) { return commit("link", make); }, result);
  const std::unique_ptr<AtlasPairQueue> queue = store_->share(pairs);
  if (queue == nullptr) {
    linker.align(pairs, state, known, pairs.size());
    return result;
  }
  // A few at a time, so that all processes end at about the same time.
  const std::size_t batch = 2 * std::size_t{execution.executor.threads()};
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
      // What a person stated, also by unlink(), stays.
      if (link.kind != LinkKind::kPlacement) known.insert(pair_of(link.target, link.source));
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
    refuse_if(changes.removed_links.empty(), store_->name(), "no link between " + names,
              "two linked maps");
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

}  // namespace cairn
