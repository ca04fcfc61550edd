// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <queue>
#include <utility>

#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/geometry/angles.hpp"
#include "cairn/report/detail/map_builder.hpp"
#include "cairn/report/sections.hpp"

namespace cairn::report {
namespace {

constexpr std::size_t kMarksShown = 500;  // of one span; more cannot be distinguished
constexpr const char* kSinceStart = "Time since the session's first keyframe";

std::string unit_of(LengthUnit unit) {
  return unit == LengthUnit::kMetres ? "m" : "map units";
}

std::string_view use_text(LinkUse use) {
  switch (use) {
    case LinkUse::kUsed:
      return "used";
    case LinkUse::kContradicted:
      return "contradicted by other links";
    case LinkUse::kUndecided:
      return "aligned, not optimised yet";
    case LinkUse::kAmbiguous:
      return "ambiguous";
    case LinkUse::kRejected:
      break;
  }
  return "rejected";
}

void require_indices(std::span<const NetworkMap> maps, std::span<const NetworkEdge> edges) {
  const auto require = [&](std::size_t index, const char* what) {
    if (index < maps.size()) return;
    throw Error(ErrorKind::kMisuse, what, fmt::format("{}", index),
                fmt::format("one of {} maps", maps.size()));
  };
  for (const NetworkMap& map : maps) {
    if (map.frame) require(*map.frame, "NetworkMap.frame");
  }
  for (const NetworkEdge& edge : edges) {
    require(edge.target, "NetworkEdge.target");
    require(edge.source, "NetworkEdge.source");
  }
}

// Each map's pose by the surest chain of used links from its frame's map, as Prim's tree grows; a map that
// no chain reaches keeps its optimised pose.
std::vector<Similarity3> chained_poses(std::span<const NetworkMap> maps,
                                       std::span<const NetworkEdge> edges) {
  std::vector<Similarity3> poses;
  std::vector<bool> placed;
  for (std::size_t i = 0; i < maps.size(); ++i) {
    poses.push_back(maps[i].frame_from_map);
    placed.push_back(maps[i].frame == i);
  }
  std::vector<const NetworkEdge*> order;
  for (const NetworkEdge& edge : edges) {
    const bool usable = edge.use == LinkUse::kUsed && edge.target_from_source &&
                        maps[edge.target].frame &&
                        maps[edge.target].frame == maps[edge.source].frame;
    if (usable) order.push_back(&edge);
  }
  std::stable_sort(order.begin(), order.end(), [](const auto* a, const auto* b) {
    return a->probability.value_or(1.0) > b->probability.value_or(1.0);
  });
  // Ranks of the links that end at each map, and of those with an end that is placed: the surest first.
  std::vector<std::vector<std::size_t>> at_map(maps.size());
  for (std::size_t rank = 0; rank < order.size(); ++rank) {
    at_map[order[rank]->target].push_back(rank);
    at_map[order[rank]->source].push_back(rank);
  }
  std::priority_queue<std::size_t, std::vector<std::size_t>, std::greater<>> next;
  const auto offer_links_of = [&](std::size_t map) {
    for (const std::size_t rank : at_map[map]) next.push(rank);
  };
  for (std::size_t i = 0; i < maps.size(); ++i) {
    if (placed[i]) offer_links_of(i);
  }
  while (!next.empty()) {
    const NetworkEdge& edge = *order[next.top()];
    next.pop();
    if (placed[edge.target] && placed[edge.source]) continue;
    const bool forward = placed[edge.target];
    const std::size_t added = forward ? edge.source : edge.target;
    poses[added] = forward ? poses[edge.target] * *edge.target_from_source
                           : poses[edge.source] * edge.target_from_source->inverse();
    placed[added] = true;
    offer_links_of(added);
  }
  return poses;
}

double rotation_between(const Similarity3& a, const Similarity3& b) {
  const Eigen::AngleAxisd turn(
      Eigen::Matrix3d(a.rigid().rotation().transpose() * b.rigid().rotation()));
  return std::abs(turn.angle());
}

NetworkLink make_link(const NetworkEdge& edge, std::span<const NetworkMap> maps) {
  NetworkLink link;
  link.target = edge.target;
  link.source = edge.source;
  link.use = edge.use;
  link.kind = edge.kind;
  link.probability = edge.probability;
  link.reason = edge.reason;
  const NetworkMap& target = maps[edge.target];
  const NetworkMap& source = maps[edge.source];
  if (!edge.target_from_source || !target.frame || target.frame != source.frame) return link;
  const Similarity3 by_poses = target.frame_from_map.inverse() * source.frame_from_map;
  link.residual = (*edge.target_from_source * source.centre - by_poses * source.centre).norm();
  link.residual_deg = degrees(rotation_between(*edge.target_from_source, by_poses));
  return link;
}

std::vector<double> times_of(const LandmarkMap& map) {
  std::vector<double> times;
  for (const auto& time : map.frames().timestamps_s) {
    if (time && std::isfinite(*time)) times.push_back(*time);
  }
  std::sort(times.begin(), times.end());
  return times;
}

std::vector<double> thinned(const std::vector<double>& values, std::size_t most) {
  if (values.size() <= most) return values;
  std::vector<double> kept;
  for (std::size_t i = 0; i < most; ++i) kept.push_back(values[i * values.size() / most]);
  return kept;
}

Table maps_table(const Network& network) {
  const bool sessions = std::any_of(network.nodes.begin(), network.nodes.end(),
                                    [](const auto& node) { return !node.session.empty(); });
  const bool fused = std::any_of(network.nodes.begin(), network.nodes.end(),
                                 [](const auto& node) { return node.fused.has_value(); });
  Table table;
  table.columns.push_back({"Map", std::nullopt, CellType::kText, std::nullopt});
  if (sessions) table.columns.push_back({"Session", std::nullopt, CellType::kText, std::nullopt});
  table.columns.push_back({"In the frame of", std::nullopt, CellType::kText, std::nullopt});
  table.columns.push_back({"Landmarks", std::nullopt, CellType::kNumber, 0});
  if (fused) table.columns.push_back({"Fused", std::nullopt, CellType::kNumber, 0});
  table.columns.push_back({"Keyframes", std::nullopt, CellType::kNumber, 0});
  table.columns.push_back({"Why left out", std::nullopt, CellType::kText, std::nullopt});
  const bool reasons = std::any_of(network.nodes.begin(), network.nodes.end(),
                                   [](const auto& node) { return !node.reason.empty(); });
  if (!reasons) table.columns.pop_back();
  for (const NetworkNode& node : network.nodes) {
    std::vector<Scalar> row = {node.name};
    if (sessions) row.push_back(node.session.empty() ? Scalar() : Scalar(node.session));
    row.push_back(node.group ? Scalar(network.groups[*node.group].frame) : Scalar());
    row.push_back(static_cast<double>(node.landmarks));
    if (fused) row.push_back(node.fused ? Scalar(static_cast<double>(*node.fused)) : Scalar());
    row.push_back(static_cast<double>(node.keyframes));
    if (reasons) row.push_back(node.reason.empty() ? Scalar() : Scalar(node.reason));
    table.rows.push_back(std::move(row));
  }
  return table;
}

Table links_table(const Network& network) {
  Table table;
  table.columns = {{"Target", std::nullopt, CellType::kText, std::nullopt},
                   {"Source", std::nullopt, CellType::kText, std::nullopt},
                   {"Probability", std::nullopt, CellType::kProbability, std::nullopt},
                   {"Use", std::nullopt, CellType::kText, std::nullopt},
                   {"Residual distance", unit_of(network.length_unit), CellType::kNumber, 4},
                   {"Residual angle", "°", CellType::kNumber, 3},
                   {"Reason", std::nullopt, CellType::kText, std::nullopt}};
  for (const NetworkLink& link : network.links) {
    const auto number = [](const std::optional<double>& value, double factor) {
      return value ? Scalar(factor * *value) : Scalar();
    };
    table.rows.push_back({network.nodes[link.target].name, network.nodes[link.source].name,
                          number(link.probability, 1.0), std::string(use_text(link.use)),
                          number(link.residual, 1.0), number(link.residual_deg, 1.0),
                          link.reason.empty() ? Scalar() : Scalar(link.reason)});
  }
  return table;
}

// Adds the landmarks that a page shows and gives the maps' ids.
std::vector<std::optional<std::string>> add_maps(Report& report, std::span<const NetworkMap> maps,
                                                 std::size_t stride) {
  std::vector<std::optional<std::string>> ids;
  for (std::size_t i = 0; i < maps.size(); ++i) {
    if (maps[i].map == nullptr) {
      ids.emplace_back();
      continue;
    }
    detail::MapOptions options{.id = fmt::format("map-{}", i), .name = maps[i].name};
    if (stride > 1) {
      options.landmarks.emplace();
      for (std::size_t k = 0; k < maps[i].map->landmark_count(); k += stride) {
        options.landmarks->push_back(LandmarkIndex{static_cast<std::uint32_t>(k)});
      }
    }
    Map map = detail::make_map(*maps[i].map, options);
    map.columns.clear();  // colours identify the map; keeps pages of many maps small
    map.colors.clear();
    map.ellipsoids.reset();
    ids.emplace_back(map.id);
    report.maps.push_back(std::move(map));
  }
  return ids;
}

Network make_network(std::span<const NetworkMap> maps, std::span<const NetworkEdge> edges) {
  require_indices(maps, edges);
  Network network;
  network.stages = {"Own frames", "Along the links", "Optimised"};
  std::vector<std::optional<std::size_t>> group_of_frame(maps.size());
  for (const NetworkMap& map : maps) {
    if (!map.frame || group_of_frame[*map.frame]) continue;
    const NetworkMap& frame = maps[*map.frame];
    group_of_frame[*map.frame] = network.groups.size();
    network.groups.push_back(
        {frame.name, frame.map == nullptr ? std::nullopt : detail::up_of(*frame.map)});
  }
  const std::vector<Similarity3> chained = chained_poses(maps, edges);
  for (std::size_t i = 0; i < maps.size(); ++i) {
    const NetworkMap& map = maps[i];
    NetworkNode node;
    node.name = map.name;
    node.session = map.session;
    node.reason = map.reason;
    node.landmarks = map.landmarks;
    node.keyframes = map.keyframes;
    node.fused = map.fused;
    node.centre = map.centre;
    if (map.frame) {
      node.group = group_of_frame[*map.frame];
      node.group_from_node = {Similarity3(), chained[i], map.frame_from_map};
      network.length_unit = maps[*map.frame].length_unit;
    }
    network.nodes.push_back(std::move(node));
  }
  for (const NetworkEdge& edge : edges) network.links.push_back(make_link(edge, maps));
  return network;
}

// Distance of each used or contradicted link from the poses.
IntervalsChart residual_chart(const Network& network) {
  IntervalsChart chart;
  chart.x_label = fmt::format("Distance from the poses ({})", unit_of(network.length_unit));
  chart.x_scale = AxisScale::kLog;
  for (const LinkUse use : {LinkUse::kUsed, LinkUse::kContradicted}) {
    IntervalSeries series{std::string(use == LinkUse::kUsed ? "used" : "contradicted"), {}};
    for (const NetworkLink& link : network.links) {
      // A link that is the only one of a map agrees with its pose up to rounding.
      constexpr double kRounding = 1e-7;
      if (link.use != use || !link.residual || *link.residual < kRounding) continue;
      const double value = *link.residual;
      series.items.push_back(
          {fmt::format("{} ← {}", network.nodes[link.target].name, network.nodes[link.source].name),
           value, value, value});
    }
    if (!series.items.empty()) chart.series.push_back(std::move(series));
  }
  return chart;
}

// When each map's keyframes were taken; maps without times have no bar. If the longest session would take less than 2 %
// of the common axis, each session starts at zero.
SpansChart session_chart(std::span<const NetworkMap> maps) {
  struct Taken {
    std::string row;
    std::string name;
    std::vector<double> times;
  };
  std::vector<Taken> all;
  std::map<std::string, std::pair<double, double>> extents;  // of each row
  for (const NetworkMap& map : maps) {
    if (map.map == nullptr) continue;
    std::vector<double> times = times_of(*map.map);
    if (times.empty()) continue;
    const std::string& row = map.session.empty() ? map.name : map.session;
    const auto [extent, is_new] = extents.try_emplace(row, times.front(), times.back());
    extent->second.first = std::min(extent->second.first, times.front());
    extent->second.second = std::max(extent->second.second, times.back());
    all.push_back({row, map.name, std::move(times)});
  }
  double first = std::numeric_limits<double>::infinity();
  double last = -first;
  double longest = 0.0;
  for (const auto& [row, extent] : extents) {
    first = std::min(first, extent.first);
    last = std::max(last, extent.second);
    longest = std::max(longest, extent.second - extent.first);
  }
  // Days between sessions, or clocks with different starts, would shrink every bar to a line.
  constexpr double kShortest = 0.02;
  const bool common = longest == 0.0 || longest >= kShortest * (last - first);
  SpansChart chart;
  chart.x_label = common ? "Time" : kSinceStart;
  for (Taken& taken : all) {
    if (!common) {
      const double start = extents.at(taken.row).first;
      for (double& time : taken.times) time -= start;
    }
    chart.series.push_back({taken.name,
                            {{taken.row, taken.times.front(), taken.times.back(),
                              thinned(taken.times, kMarksShown)}}});
  }
  return chart;
}

}  // namespace

void add_network(Report& report, std::span<const NetworkMap> maps,
                 std::span<const NetworkEdge> edges, std::size_t shown_landmarks) {
  Network network = make_network(maps, edges);
  std::size_t landmarks = 0;
  for (const NetworkMap& map : maps) {
    if (map.map != nullptr) landmarks += map.map->landmark_count();
  }
  const std::size_t stride =
      (landmarks + shown_landmarks - 1) / std::max<std::size_t>(shown_landmarks, 1);
  const auto ids = add_maps(report, maps, stride);
  for (std::size_t i = 0; i < maps.size(); ++i) network.nodes[i].map = ids[i];
  IntervalsChart residuals = residual_chart(network);
  SpansChart sessions = session_chart(maps);
  Table map_rows = maps_table(network);
  Table link_rows = links_table(network);
  std::optional<std::string> text;
  if (stride > 1) text = fmt::format("Of {} landmarks, one in {} is shown.", landmarks, stride);
  report.sections.push_back(
      {.id = "network", .title = "Maps and links", .text = text, .content = std::move(network)});
  if (!residuals.series.empty()) {
    report.sections.push_back(
        {.id = "residuals",
         .title = "Residual per link",
         .text =
             "Distance between where a link and where the optimised poses put the centre of the "
             "source's landmarks. Where a single link places a map there is no such distance, and "
             "the link is not shown.",
         .content = Chart(std::move(residuals))});
  }
  if (!sessions.series.empty()) {
    std::string told = "When the keyframes of each map were taken.";
    if (sessions.x_label == kSinceStart) {
      told +=
          " Each session starts at zero: the sessions are far apart in time, or their clocks "
          "differ.";
    }
    report.sections.push_back({.id = "sessions",
                               .title = "Sessions",
                               .text = std::move(told),
                               .content = Chart(std::move(sessions))});
  }
  report.sections.push_back(
      {.id = "maps", .title = "Maps", .text = std::nullopt, .content = std::move(map_rows)});
  if (!link_rows.rows.empty()) {
    report.sections.push_back(
        {.id = "links", .title = "Links", .text = std::nullopt, .content = std::move(link_rows)});
  }
}

}  // namespace cairn::report
