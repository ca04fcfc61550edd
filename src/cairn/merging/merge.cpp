// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/merging/merge.hpp"

#include <algorithm>
#include <utility>

#include <fmt/format.h>

#include "cairn/alignment/alignment.hpp"
#include "cairn/core/detail/progress_share.hpp"
#include "cairn/core/error.hpp"
#include "cairn/map/turning_columns.hpp"
#include "cairn/merging/optimisation/node_extent.hpp"
#include "cairn/merging/optimisation/optimise_poses.hpp"

namespace cairn {
namespace {

double probability_of(const MapLink& link) {
  return link.probability.value_or(0.0);
}

// Says why a map is not placed.
void explain(std::size_t map, std::span<const MergeInput> maps, MergeResult& result) {
  MergedMap& merged = result.maps[map];
  std::size_t aligned = 0;
  std::optional<std::size_t> best;
  for (std::size_t i = 0; i < result.links.size(); ++i) {
    const MapLink& link = result.links[i];
    if (link.target != map && link.source != map) continue;
    if (pose_link(link)) {
      ++aligned;
    } else if (!best || probability_of(link) > probability_of(result.links[*best])) {
      best = i;
    }
  }
  if (aligned > 0) {
    merged.reason = fmt::format("aligned with {} map{}, but with none of the largest group",
                                aligned, aligned == 1 ? "" : "s");
  } else if (best) {
    const MapLink& link = result.links[*best];
    merged.likeliest_link = best;
    merged.reason = fmt::format("aligned with no other map; likeliest with {} ({}, {})",
                                maps[link.target == map ? link.source : link.target].name,
                                link_status(link.verdict), probability_text(probability_of(link)));
  } else {
    merged.reason = "no pair with another map was tried";
  }
}

}  // namespace

void MergeOptions::validate() const {
  links.validate();
  placed.validate();
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
  for (const MapLink& link : result.links) {
    if (const auto placed = pose_link(link)) graph.links.push_back(*placed);
  }
  return graph;
}

MergeResult merge(std::span<const MergeInput> maps, const MergeOptions& options) {
  options.validate();
  if (maps.size() < 2) {
    throw Error(ErrorKind::kMisuse, "maps", fmt::format("{} of them", maps.size()),
                "at least two maps");
  }
  for (const PoseLink& link : options.stated) {
    if (std::max(link.target.value, link.source.value) < maps.size()) continue;
    throw Error(ErrorKind::kMisuse, "MergeOptions.stated",
                fmt::format("a link of maps {} and {}", link.target.value, link.source.value),
                fmt::format("indices below {}", maps.size()));
  }
  MergeResult result;
  result.maps.resize(maps.size());
  std::vector<const LandmarkMap*> pointers;
  std::vector<NodeExtent> extents;
  for (const MergeInput& input : maps) {
    require_no_splats(*input.map, input.name);  // before the long work
    pointers.push_back(input.map);
    extents.push_back(node_extent(*input.map));
  }
  LinkOptions how = options.links;
  how.seed = options.seed;
  how.execution = options.execution;
  how.execution.progress = stage_of(options.execution.progress, 0.0, 0.9);
  result.links = link_maps(pointers, how);
  for (const PoseLink& link : options.stated) result.links.push_back(stated_link(link));
  result.used.assign(result.links.size(), false);

  std::vector<std::size_t> link_of;  // by link of the graph
  for (std::size_t i = 0; i < result.links.size(); ++i) {
    if (pose_link(result.links[i])) link_of.push_back(i);
  }
  const OptimisedPoses poses = optimise_poses(pose_graph(maps, result), extents);
  for (std::size_t i = 0; i < link_of.size(); ++i) result.used[link_of[i]] = poses.agrees[i];
  for (const std::size_t link : poses.tree) result.tree.push_back(link_of[link]);
  const bool any = !poses.tree.empty();
  std::vector<PlacedMap> placed;
  std::vector<std::size_t> index_of;
  for (std::size_t i = 0; i < maps.size(); ++i) {
    MergedMap& merged = result.maps[i];
    merged.placed = any && poses.world_from_node[i].has_value();
    if (!merged.placed) {
      explain(i, maps, result);
      continue;
    }
    merged.world_from_map = poses.world_from_node[i];
    merged.covariance = poses.covariances[i];
    placed.push_back({maps[i].map, maps[i].name, *merged.world_from_map, merged.covariance});
    index_of.push_back(i);
  }
  if (!any) return result;
  MergePlacedOptions fusing = options.placed;
  fusing.fusion.seed = options.seed;
  fusing.fusion.execution = options.execution;
  fusing.fusion.execution.progress = stage_of(options.execution.progress, 0.9, 1.0);
  fusing.fusion.log = options.log;
  std::vector<MapLink> used;
  std::vector<std::size_t> place_of(maps.size());
  for (std::size_t i = 0; i < index_of.size(); ++i) place_of[index_of[i]] = i;
  for (std::size_t i = 0; i < result.links.size(); ++i) {
    if (!result.used[i]) continue;
    MapLink& link = used.emplace_back(result.links[i]);
    link.target = place_of[link.target];
    link.source = place_of[link.source];
  }
  MergedPlaced merged = merge_placed(placed, used, fusing);
  for (std::size_t i = 0; i < index_of.size(); ++i) {
    result.maps[index_of[i]].fusion = merged.maps[i];
    result.maps[index_of[i]].bend = merged.bends[i];
  }
  result.map = std::move(merged.map);
  result.adjustment = merged.adjustment;
  return result;
}

}  // namespace cairn
