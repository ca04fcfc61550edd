// SPDX-License-Identifier: BSD-3-Clause
#include "support/merge_report.hpp"

#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "cairn/pose_graph/optimise_poses.hpp"
#include "cairn/report/sections.hpp"

#include "support/map_lists.hpp"

namespace cairn::cli {
namespace {

report::LinkUse use_of(const Link& link, bool used) {
  if (link.connects()) {
    return used ? report::LinkUse::kUsed : report::LinkUse::kContradicted;
  }
  return link.verdict == Verdict::kAmbiguous ? report::LinkUse::kAmbiguous
                                             : report::LinkUse::kRejected;
}

// "Placed 3 of 4 maps in the frame of monday: 61,204 landmarks became 44,910. Left out: cellar, attic."
std::string answer_of(std::span<const MergeInput> maps, const MergeResult& result) {
  std::size_t before = 0;
  std::string frame;
  std::vector<std::string> left_out;
  for (std::size_t i = 0; i < maps.size(); ++i) {
    const MergedMap& map = result.maps[i];
    if (map.fusion) before += map.fusion->landmarks;
    if (map.placed && frame.empty()) frame = maps[i].name;
    if (!map.placed) left_out.push_back(maps[i].name);
  }
  if (!result.map) return "No two maps are aligned; no map is written.";
  std::string text = fmt::format("Placed {} of {} maps in the frame of {}: {} landmarks became {}.",
                                 result.placed(), maps.size(), frame, with_commas(before),
                                 with_commas(result.map->landmark_count()));
  if (!left_out.empty()) text += fmt::format(" Left out: {}.", fmt::join(left_out, ", "));
  return text;
}

}  // namespace

void add_merge(report::Report& report, std::span<const MergeInput> maps,
               const MergeResult& result) {
  report.subtitle = answer_of(maps, result);
  std::optional<std::size_t> frame;
  std::vector<report::NetworkMap> nodes;
  for (std::size_t i = 0; i < maps.size(); ++i) {
    const MergedMap& merged = result.maps[i];
    const LandmarkMap& map = *maps[i].map;
    if (merged.placed && !frame) frame = i;
    report::NetworkMap node{.name = maps[i].name, .map = &map, .reason = merged.reason};
    if (merged.placed) {
      node.frame = frame;
      node.frame_from_map = *merged.world_from_map;
    }
    if (merged.fusion) node.fused = merged.fusion->fused;
    node.landmarks = map.landmark_count();
    node.keyframes = map.frame_count();
    node.centre = node_extent(map.landmarks().positions).centre;
    node.length_unit = map.info().length_unit;
    nodes.push_back(std::move(node));
  }
  std::vector<report::NetworkEdge> edges;
  for (std::size_t i = 0; i < result.links.size(); ++i) {
    const Link& link = result.links[i];
    edges.push_back({.target = link.target.value,
                     .source = link.source.value,
                     .use = use_of(link, result.used[i]),
                     .kind = std::string(to_string(link.kind)),
                     .probability = link.probability,
                     .reason = link.reason,
                     .target_from_source = link.target_from_source});
  }
  report::add_network(report, nodes, edges);
}

}  // namespace cairn::cli
