// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/merging/fusion/merge_placed.hpp"

#include <algorithm>
#include <string>
#include <tuple>
#include <utility>

#include <fmt/format.h>

#include "cairn/adjustment/measurements.hpp"
#include "cairn/core/error.hpp"
#include "cairn/formats/content_uuid.hpp"
#include "cairn/merging/detail/pose_edges.hpp"
#include "cairn/merging/detail/pose_least_squares.hpp"
#include "cairn/merging/fusion/straighten_maps.hpp"
#include "cairn/merging/optimisation/node_extent.hpp"

namespace cairn {
namespace {

// Why the merged map cannot be adjusted; empty if it can.
std::string adjustment_defect(std::span<const PlacedMap> maps) {
  bool observed = false;
  for (const PlacedMap& placed : maps) {
    if (placed.map->observations().offsets.empty()) continue;
    observed = true;
    const std::string defect = measurement_defect(*placed.map);
    if (!defect.empty()) return placed.name + ": " + defect;
  }
  return observed ? "" : "no map knows its observations";
}

FuseAndAdjustOptions with_adjustment(const MergePlacedOptions& options) {
  FuseAndAdjustOptions how;
  how.fusion = options.fusion;
  how.adjustment = options.adjustment;
  how.adjustment.execution = options.fusion.execution;
  how.matching_rounds = options.matching_rounds;
  return how;
}

// Covariances of the maps' poses relative to the largest map, from the links between them. None if the links do not
// determine all poses.
void set_relative_covariances(std::span<const MapLink> links, std::vector<PlacedMap>& maps) {
  if (maps.size() < 3) return;  // of two, one is exact in any case
  PoseGraph graph;
  std::vector<NodeExtent> extents;
  for (std::size_t i = 0; i < maps.size(); ++i) {
    graph.nodes.push_back({NodeId{i}, {}, {}, {}});
    extents.push_back(node_extent(*maps[i].map));
  }
  for (const MapLink& link : links) {
    if (const auto edge = pose_link(link)) graph.links.push_back(*edge);
  }
  const std::vector<std::size_t> order = largest_first(maps);
  std::vector<std::size_t> rank(maps.size());
  std::vector<Similarity3> poses;
  for (std::size_t i = 0; i < order.size(); ++i) {
    rank[order[i]] = i;
    poses.push_back(maps[order[i]].world_from_map);
  }
  std::vector<PoseEdge> edges = pose_edges(graph, extents);
  for (PoseEdge& edge : edges) {
    edge.target = rank[edge.target];
    edge.source = rank[edge.source];
  }
  std::stable_sort(edges.begin(), edges.end(), [](const PoseEdge& a, const PoseEdge& b) {
    return std::tuple(a.target, a.source) < std::tuple(b.target, b.source);
  });
  try {
    const std::vector<Matrix7d> covariances =
        PoseLeastSquares(std::move(edges), std::move(poses)).covariances();
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

void MergePlacedOptions::validate() const {
  with_adjustment(*this).validate();
}

MergedPlaced merge_placed(std::span<const PlacedMap> given, std::span<const MapLink> links,
                          const MergePlacedOptions& options) {
  options.validate();
  std::vector<PlacedMap> maps(given.begin(), given.end());
  std::vector<std::optional<MapBend>> bends(maps.size());
  std::vector<std::optional<StraightenedMap>> straight(maps.size());
  if (options.straighten) straight = straighten_maps(given, links, options.fusion);
  for (std::size_t i = 0; i < maps.size(); ++i) {
    if (!straight[i]) continue;
    maps[i].map = &straight[i]->map;
    bends[i] = straight[i]->bend;
  }
  set_relative_covariances(links, maps);
  const std::string defect = options.adjust ? adjustment_defect(maps) : "";
  if (!defect.empty() && options.fusion.log) options.fusion.log("not adjusted: " + defect);
  if (!options.adjust || !defect.empty()) {
    FusionResult fused = fuse_maps(maps, options.fusion);
    return {with_content_uuid(std::move(fused.map)), std::move(fused.maps), std::move(bends), {}};
  }
  AdjustedFusion fused = fuse_and_adjust(maps, with_adjustment(options));
  return {with_content_uuid(with_provenance(std::move(fused.map), fused.adjustment)),
          std::move(fused.maps), std::move(bends), fused.adjustment};
}

}  // namespace cairn
