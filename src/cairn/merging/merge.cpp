// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/merging/merge.hpp"

#include <algorithm>
#include <iterator>
#include <utility>

#include <fmt/format.h>

#include "cairn/alignment/align.hpp"
#include "cairn/core/error.hpp"
#include "cairn/map/operations.hpp"
#include "cairn/merging/detail/join_splats.hpp"

namespace cairn {
namespace {

double probability_of(const Link& link) {
  return link.probability.value_or(0.0);
}

bool is_of(const Link& link, std::size_t map) {
  return link.target.value == map || link.source.value == map;
}

// States why a map is not placed.
void explain(std::size_t map, std::span<const MergeInput> maps, MergeResult& result) {
  MergedMap& merged = result.maps[map];
  std::size_t aligned = 0;
  std::optional<std::size_t> best;
  for (std::size_t i = 0; i < result.links.size(); ++i) {
    const Link& link = result.links[i];
    if (!is_of(link, map)) continue;
    if (link.connects()) {
      ++aligned;
    } else if (!best || probability_of(link) > probability_of(result.links[*best])) {
      best = i;
    }
  }
  if (aligned > 0) {
    merged.reason = fmt::format("aligned with {} map{}, but with none of the largest group",
                                aligned, aligned == 1 ? "" : "s");
  } else if (best) {
    const Link& link = result.links[*best];
    merged.likeliest_link = best;
    merged.reason =
        fmt::format("aligned with no other map; likeliest with {} ({}, {})",
                    maps[link.target.value == map ? link.source.value : link.target.value].name,
                    link.status(), probability_text(probability_of(link)));
  } else {
    merged.reason = "no pair with another map was tried";
  }
}

const LandmarkMap& aligned_map(const MergeInput& input) {
  return input.model != nullptr ? *input.model : *input.map;
}

bool is_same_map(const LandmarkMap& a, const LandmarkMap& b) {
  return are_one_map(a.landmarks().positions, b.landmarks().positions);
}

}  // namespace

void MergeOptions::validate() const {
  links.validate();
  FusionOptions::validate();
}

std::size_t MergeResult::placed() const {
  return static_cast<std::size_t>(
      std::count_if(maps.begin(), maps.end(), [](const MergedMap& one) { return one.placed; }));
}

PoseGraph pose_graph(std::span<const MergeInput> maps, const MergeResult& result) {
  PoseGraph graph;
  for (std::size_t i = 0; i < maps.size(); ++i) {
    graph.nodes.push_back({NodeId{i}, maps[i].name, maps[i].session,
                           result.maps[i].world_from_map.value_or(Similarity3())});
  }
  std::copy_if(result.links.begin(), result.links.end(), std::back_inserter(graph.links),
               [](const Link& link) { return link.connects(); });
  return graph;
}

MergeResult place_maps(std::span<const MergeInput> maps, const MergeOptions& options,
                       const Execution& execution) {
  options.validate();
  refuse_if(maps.size() < 2, "maps", fmt::format("{} of them", maps.size()), "at least two maps");
  for (const Link& link : options.stated) {
    if (std::max(link.target.value, link.source.value) < maps.size()) continue;
    throw Error(ErrorKind::kMisuse, "MergeOptions.stated",
                fmt::format("a link of maps {} and {}", link.target.value, link.source.value),
                fmt::format("indices below {}", maps.size()));
  }
  MergeResult result;
  result.maps.resize(maps.size());
  std::vector<const LandmarkMap*> pointers;
  std::vector<std::string> sessions;
  std::vector<NodeExtent> extents;
  std::vector<PlacedMap> joinable;
  for (std::size_t i = 0; i < maps.size(); ++i) {
    for (std::size_t k = 0; k < i; ++k) {
      refuse_if(is_same_map(*maps[i].map, *maps[k].map) ||
                    is_same_map(aligned_map(maps[i]), aligned_map(maps[k])),
                "maps", fmt::format("{} and {} are one map", maps[k].name, maps[i].name),
                "each map once; a repeated map would count as independent evidence");
    }
    joinable.push_back({maps[i].map, maps[i].name, {}});
  }
  detail::are_splats(joinable);  // throws before the long work
  for (const MergeInput& input : maps) {
    if (input.model != nullptr) require_one_frame(*input.map, *input.model, input.name);
    pointers.push_back(&aligned_map(input));
    sessions.push_back(input.session);
    extents.push_back(node_extent(pointers.back()->landmarks().positions));
  }
  MapsInMemory store(pointers, std::move(sessions));
  result.links = link_maps(store, options.links, execution);
  for (const Link& stated : options.stated) {
    Link& link = result.links.emplace_back(stated);
    link.verdict.reset();
    if (link.reason.empty()) link.reason = fmt::format("stated by {}", to_string(link.kind));
  }
  result.used.assign(result.links.size(), false);

  std::vector<std::size_t> link_of;  // by link of the graph
  for (std::size_t i = 0; i < result.links.size(); ++i) {
    if (result.links[i].connects()) link_of.push_back(i);
  }
  const OptimisedPoses poses = optimise_poses(pose_graph(maps, result), extents);
  for (std::size_t i = 0; i < link_of.size(); ++i) result.used[link_of[i]] = poses.agrees[i];
  for (const std::size_t link : poses.tree) result.tree.push_back(link_of[link]);
  for (std::size_t i = 0; i < maps.size(); ++i) {
    MergedMap& merged = result.maps[i];
    merged.placed = !poses.tree.empty() && poses.world_from_node[i].has_value();
    if (!merged.placed) {
      explain(i, maps, result);
      continue;
    }
    merged.world_from_map = poses.world_from_node[i];
    merged.covariance = poses.covariances[i];
  }
  return result;
}

std::vector<std::vector<FrameIndex>> fuse_placed(std::span<const MergeInput> maps,
                                                 const FusionOptions& options, MergeResult& result,
                                                 const Execution& execution) {
  std::vector<std::vector<FrameIndex>> frames(maps.size());
  std::vector<PlacedMap> placed;
  std::vector<std::size_t> index_of;
  std::vector<std::size_t> place_of(maps.size());
  for (std::size_t i = 0; i < maps.size(); ++i) {
    const MergedMap& map = result.maps[i];
    if (!map.placed) continue;
    place_of[i] = placed.size();
    placed.push_back({maps[i].map, maps[i].name, *map.world_from_map, map.covariance});
    placed.back().model = maps[i].model;
    placed.back().disposable = maps[i].disposable;
    index_of.push_back(i);
  }
  if (placed.empty()) return frames;
  std::vector<Link> used;
  for (std::size_t i = 0; i < result.links.size(); ++i) {
    const Link& found = result.links[i];
    if (!result.used[i] || !result.maps[found.target.value].placed) continue;
    Link& link = used.emplace_back(found);
    link.target = NodeId{place_of[link.target.value]};
    link.source = NodeId{place_of[link.source.value]};
  }
  MergedPlaced merged = merge_placed(placed, used, options, execution);
  for (std::size_t i = 0; i < index_of.size(); ++i) {
    MergedMap& map = result.maps[index_of[i]];
    map.fusion = merged.maps[i];
    map.bend = merged.bends[i];
    map.fold = std::move(merged.folds[i]);
    if (map.fold) map.fold->other = index_of[map.fold->other];
    frames[index_of[i]] = std::move(merged.frames[i]);
  }
  result.map = std::move(merged.map);
  result.adjustment = merged.adjustment;
  return frames;
}

MergeResult merge(std::span<const MergeInput> maps, const MergeOptions& options,
                  const Execution& execution) {
  MergeResult result = place_maps(maps, options, execution.stage(0.0, 0.9));
  fuse_placed(maps, options, result, execution.stage(0.9, 1.0));
  return result;
}

}  // namespace cairn
