// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/merging/fusion/merge_placed.hpp"

#include <algorithm>
#include <string>
#include <utility>

#include <fmt/format.h>

#include "cairn/adjustment/detail/measurements.hpp"
#include "cairn/core/error.hpp"
#include "cairn/formats/map_file.hpp"
#include "cairn/map/folds.hpp"
#include "cairn/map/operations.hpp"
#include "cairn/merging/detail/fuse_and_adjust.hpp"
#include "cairn/merging/detail/straighten_maps.hpp"
#include "cairn/pose_graph/optimise_poses.hpp"

namespace cairn {
namespace {

// Why the merged map cannot be adjusted; empty if it can.
std::string adjustment_defect(std::span<const PlacedMap> maps) {
  bool observed = false;
  for (const PlacedMap& placed : maps) {
    if (placed.map->observations().offsets.empty()) continue;
    observed = true;
    const std::string defect = detail::measurement_defect(*placed.map);
    if (!defect.empty()) return placed.name + ": " + defect;
  }
  return observed ? "" : "no map knows its observations";
}

// Covariances of the maps' poses relative to the largest map, from the links between them. None if the links do not
// determine all poses.
void set_relative_covariances(std::span<const Link> links, std::vector<PlacedMap>& maps) {
  if (maps.size() < 3) return;  // of two, one is exact in any case
  const std::vector<std::size_t> order = largest_first(maps);
  std::vector<std::size_t> rank(maps.size());
  PoseGraph graph;
  std::vector<NodeExtent> extents;
  for (std::size_t i = 0; i < order.size(); ++i) {
    const PlacedMap& placed = maps[order[i]];
    rank[order[i]] = i;
    graph.nodes.push_back({NodeId{i}, {}, {}, placed.world_from_map});
    extents.push_back(node_extent(placed.map->landmarks().positions));
  }
  for (const Link& link : links) {
    if (!link.connects()) continue;
    Link& sorted = graph.links.emplace_back(link);
    sorted.target = NodeId{rank[link.target.value]};
    sorted.source = NodeId{rank[link.source.value]};
  }
  std::stable_sort(graph.links.begin(), graph.links.end(), [](const Link& a, const Link& b) {
    return std::pair(a.target, a.source) < std::pair(b.target, b.source);
  });
  try {
    const std::vector<Matrix7d> covariances = covariances_of_poses(graph, extents);
    for (std::size_t i = 0; i < maps.size(); ++i) {
      maps[i].relative_covariance = covariances[rank[i]];
    }
  } catch (const Error&) {  // those in the world serve instead
  }
}

LandmarkMap with_provenance(LandmarkMap map, const MergeAdjustment& adjustment) {
  MapTables tables = std::move(map).tables();
  tables.info.provenance.push_back(fmt::format(
      "adjusted: {} observations, root mean square residual {:.3f} px, {:.3f} px before",
      adjustment.observations, adjustment.final_rms_px, adjustment.initial_rms_px));
  return LandmarkMap(std::move(tables));
}

}  // namespace

MergedPlaced merge_placed(std::span<const PlacedMap> given, std::span<const Link> links,
                          const FusionOptions& options, const Execution& execution) {
  options.validate();
  std::vector<PlacedMap> maps(given.begin(), given.end());
  std::vector<MapInWorld> in_world;
  for (const PlacedMap& placed : maps) in_world.push_back({placed.map, placed.world_from_map});
  std::vector<std::optional<MapFold>> folds = find_folds(in_world);
  std::vector<LandmarkMap> unfolded(maps.size());
  for (std::size_t i = 0; i < maps.size(); ++i) {
    if (!folds[i]) continue;
    if (execution.log) {
      execution.log(fold_text(*folds[i], *maps[i].map, maps[i].name, maps[folds[i]->other].name) +
                    "; they are left out");
    }
    unfolded[i] = without_frames(*maps[i].map, folds[i]->frames);
    maps[i].map = &unfolded[i];
  }
  std::vector<std::optional<MapBend>> bends(maps.size());
  std::vector<std::optional<detail::StraightenedMap>> straight(maps.size());
  if (options.straighten) straight = detail::straighten_maps(maps, links, options, execution);
  for (std::size_t i = 0; i < maps.size(); ++i) {
    if (!straight[i]) continue;
    maps[i].map = &straight[i]->map;
    bends[i] = straight[i]->bend;
  }
  set_relative_covariances(links, maps);
  const std::string defect = options.adjust ? adjustment_defect(maps) : "";
  if (!defect.empty() && execution.log) execution.log("not adjusted: " + defect);
  MergedPlaced merged;
  if (options.adjust && defect.empty()) {
    merged = detail::fuse_and_adjust(maps, options, execution);
    merged.map = with_provenance(std::move(merged.map), *merged.adjustment);
  } else {
    FusionResult fused = fuse_maps(maps, options, execution);
    merged.map = std::move(fused.map);
    merged.maps = std::move(fused.maps);
    merged.frames = std::move(fused.frames);
  }
  merged.folds = std::move(folds);
  merged.map = with_content_uuid(std::move(merged.map));
  merged.bends = std::move(bends);
  return merged;
}

}  // namespace cairn
