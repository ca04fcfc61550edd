// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <optional>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/core/error.hpp"
#include "cairn/geometry/angles.hpp"
#include "cairn/map/synthetic.hpp"
#include "cairn/report/report.hpp"
#include "cairn/report/sections.hpp"

namespace cairn::report {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

Similarity3 shift(double x, double yaw_deg = 0.0) {
  return Rigid3::from_roll_pitch_yaw({x, 0.0, 0.0}, 0.0, 0.0, radians(yaw_deg));
}

NetworkMap placed(const std::string& name, const Similarity3& pose, std::size_t frame = 0) {
  NetworkMap map;
  map.name = name;
  map.frame = frame;
  map.frame_from_map = pose;
  return map;
}

NetworkEdge edge(std::size_t target, std::size_t source, const Similarity3& transform,
                 double probability, LinkUse use = LinkUse::kUsed) {
  return {.target = target,
          .source = source,
          .use = use,
          .probability = probability,
          .target_from_source = transform};
}

// Three maps in a row, 1 m apart, whose links are each off by some millimetres; a fourth is left out.
struct Row {
  std::vector<NetworkMap> maps = {placed("a", shift(0.0)), placed("b", shift(1.0)),
                                  placed("c", shift(2.0)),
                                  NetworkMap{.name = "d", .reason = "far"}};
  std::vector<NetworkEdge> edges = {edge(0, 1, shift(1.001), 0.999),
                                    edge(1, 2, shift(1.002), 0.998),
                                    edge(0, 2, shift(2.3), 0.9999, LinkUse::kContradicted),
                                    NetworkEdge{.target = 0, .source = 3, .probability = 0.1}};
};

const Section* section_of(const Report& report, std::string_view id) {
  const auto found = std::find_if(report.sections.begin(), report.sections.end(),
                                  [&](const Section& one) { return one.id == id; });
  return found == report.sections.end() ? nullptr : &*found;
}

Report report_of(std::span<const NetworkMap> maps, std::span<const NetworkEdge> edges) {
  Report report;
  report.title = "t";
  add_network(report, maps, edges);
  return report;
}

Network network_of(std::span<const NetworkMap> maps, std::span<const NetworkEdge> edges) {
  return std::get<Network>(section_of(report_of(maps, edges), "network")->content);
}

template <class Kind>
Kind chart_of(const Report& report, std::string_view id) {
  return std::get<Kind>(std::get<Chart>(section_of(report, id)->content));
}

TEST(MakeNetwork, GoesFromOwnFramesAlongTheLinksToTheOptimisedPoses) {
  const Row row;
  const Network network = network_of(row.maps, row.edges);
  ASSERT_THAT(network.stages, SizeIs(3));
  ASSERT_THAT(network.nodes[2].group_from_node, SizeIs(3));
  EXPECT_EQ(network.nodes[2].group_from_node[0].matrix(), Matrix4d::Identity());
  EXPECT_NEAR(network.nodes[2].group_from_node[1].translation().x(), 2.003, 1e-12);
  EXPECT_NEAR(network.nodes[2].group_from_node[2].translation().x(), 2.0, 1e-12);
  EXPECT_EQ(network.nodes[3].group, std::nullopt);
  EXPECT_THAT(network.nodes[3].group_from_node, IsEmpty());
}

TEST(MakeNetwork, ChainsTheSurestUsedLinks) {
  Row row;
  row.edges.push_back(edge(2, 0, shift(-2.5), 0.99));  // usable, but less sure than by way of b
  const Network network = network_of(row.maps, row.edges);
  EXPECT_NEAR(network.nodes[2].group_from_node[1].translation().x(), 2.003, 1e-12);
}

TEST(MakeNetwork, ChainsAlongManyLinksInEitherDirection) {
  constexpr std::size_t kMaps = 20000;
  std::vector<NetworkMap> maps;
  std::vector<NetworkEdge> edges;
  for (std::size_t i = 0; i < kMaps; ++i) {
    maps.push_back(placed("", shift(0.0)));
    if (i == 0) continue;
    // The surest links are the farthest from the frame.
    const double probability = 0.5 + 0.4 * static_cast<double>(i) / kMaps;
    edges.push_back(i % 2 == 0 ? edge(i - 1, i, shift(1.0), probability)
                               : edge(i, i - 1, shift(-1.0), probability));
  }
  const Network network = network_of(maps, edges);
  EXPECT_NEAR(network.nodes.back().group_from_node[1].translation().x(), kMaps - 1.0, 1e-6);
}

TEST(MakeNetwork, AGroupIsNamedByItsFrame) {
  Row row;
  row.maps.push_back(placed("e", shift(0.0), 4));
  row.maps.push_back(placed("f", shift(5.0), 4));
  const Network network = network_of(row.maps, row.edges);
  ASSERT_THAT(network.groups, SizeIs(2));
  EXPECT_EQ(network.groups[1].frame, "e");
  EXPECT_EQ(network.nodes[5].group, 1U);
}

TEST(MakeNetwork, ResidualsAreDistanceAndAngleAtTheSourcesCentre) {
  std::vector<NetworkMap> maps = {placed("a", shift(0.0)), placed("b", shift(1.0, 90.0))};
  maps[1].centre = {1.0, 0.0, 0.0};
  const std::vector<NetworkEdge> edges = {edge(0, 1, shift(1.0, 91.0), 1.0)};
  const Network network = network_of(maps, edges);
  EXPECT_NEAR(*network.links[0].residual_deg, 1.0, 1e-9);
  EXPECT_NEAR(*network.links[0].residual, 2.0 * std::sin(radians(0.5)), 1e-9);
}

TEST(MakeNetwork, RefusesIndicesThatAreNoMaps) {
  Row row;
  row.edges.push_back(edge(0, 9, shift(0.0), 1.0));
  EXPECT_THROW(network_of(row.maps, row.edges), Error);
}

TEST(ResidualChart, ShowsUsedAndContradictedLinksApart) {
  const Row row;
  const IntervalsChart chart =
      chart_of<IntervalsChart>(report_of(row.maps, row.edges), "residuals");
  ASSERT_THAT(chart.series, SizeIs(2));
  EXPECT_EQ(chart.series[0].items.size(), 2U);
  EXPECT_EQ(chart.series[1].name, "contradicted");
  EXPECT_NEAR(chart.series[1].items[0].value, 0.3, 1e-12);
  EXPECT_EQ(chart.series[0].items[0].name, "a ← b");
}

TEST(ResidualChart, LeavesOutLinksThatAloneSayWhereAMapIs) {
  const std::vector<NetworkMap> maps = {placed("a", shift(0.0)), placed("b", shift(1.0))};
  const std::vector<NetworkEdge> edges = {edge(0, 1, shift(1.0), 1.0)};
  EXPECT_EQ(section_of(report_of(maps, edges), "residuals"), nullptr);
}

// Keyframes one second apart.
LandmarkMap map_from(double start_s, std::size_t frames) {
  MapTables tables = std::move(synthetic_pair({}).target).tables();
  for (std::size_t i = 0; i < tables.frames.timestamps_s.size(); ++i) {
    tables.frames.timestamps_s[i] =
        i < frames ? std::optional(start_s + static_cast<double>(i)) : std::nullopt;
  }
  return LandmarkMap(std::move(tables));
}

TEST(SessionChart, KeepsOneClockUnlessABarWouldBeALine) {
  const LandmarkMap first = map_from(1000.0, 11);
  const LandmarkMap later = map_from(1100.0, 6);
  const LandmarkMap other_clock = map_from(1.7e9, 6);
  std::vector<NetworkMap> maps = {placed("a", shift(0.0)), placed("b", shift(1.0))};
  maps[0].map = &first;
  maps[1].map = &later;
  SpansChart chart = chart_of<SpansChart>(report_of(maps, {}), "sessions");
  ASSERT_THAT(chart.series, SizeIs(2));
  EXPECT_EQ(chart.series[0].spans[0].start, 1000.0);
  EXPECT_EQ(chart.series[1].spans[0].end, 1105.0);
  EXPECT_EQ(chart.x_label, "Time");

  maps[1].map = &other_clock;
  chart = chart_of<SpansChart>(report_of(maps, {}), "sessions");
  ASSERT_THAT(chart.series, SizeIs(2));
  for (const SpanSeries& series : chart.series) EXPECT_EQ(series.spans[0].start, 0.0);
  EXPECT_EQ(chart.series[0].spans[0].end, 10.0);
  EXPECT_EQ(chart.series[1].spans[0].end, 5.0);
  EXPECT_EQ(chart.series[1].spans[0].marks.back(), 5.0);
  EXPECT_THAT(chart.x_label, HasSubstr("since the session's first keyframe"));
  const Report report = report_of(maps, {});
  EXPECT_THAT(*section_of(report, "sessions")->text, HasSubstr("Each session starts at zero"));

  // Maps of one session keep their order in time.
  maps[0].session = maps[1].session = "s";
  maps[1].map = &later;
  maps.push_back(placed("c", shift(2.0)));
  maps[2].map = &other_clock;
  chart = chart_of<SpansChart>(report_of(maps, {}), "sessions");
  EXPECT_EQ(chart.series[1].spans[0].start, 100.0);
  EXPECT_EQ(chart.series[2].spans[0].start, 0.0);
}

TEST(LinksTable, LeavesTheWordingOfProbabilitiesToThePage) {
  Row row;
  row.edges[0].probability = 0.99998;
  const Report report = report_of(row.maps, row.edges);
  const auto& table = std::get<Table>(section_of(report, "links")->content);
  EXPECT_EQ(table.columns[2].type, CellType::kProbability);
  EXPECT_EQ(table.rows[0][2], Scalar(0.99998));
}

TEST(AddNetwork, ShowsOneInSoManyOfVeryManyLandmarksAndSaysSo) {
  const SyntheticPair pair = synthetic_pair({});
  std::vector<NetworkMap> maps = {placed("a", shift(0.0)), placed("b", shift(1.0))};
  maps[0].map = &pair.target;
  maps[1].map = &pair.source;
  const std::vector<NetworkEdge> edges = {edge(0, 1, shift(1.0), 1.0)};
  Report report;
  report.title = "t";
  add_network(report, maps, edges, 100);
  std::size_t shown = 0;
  for (const Map& map : report.maps) shown += map.count;
  EXPECT_LE(shown, 102U);
  EXPECT_GE(shown, 90U);
  ASSERT_TRUE(report.sections[0].text.has_value());
  EXPECT_THAT(*report.sections[0].text, HasSubstr("one in"));
  std::vector<std::string> ids;
  for (const Section& section : report.sections) ids.push_back(section.id);
  EXPECT_THAT(ids, ElementsAre("network", "sessions", "maps", "links"));
}

TEST(AddNetwork, WritesEvenWhatHasNoPoseAndNoLandmarks) {
  Row row;
  for (NetworkMap& map : row.maps) map.frame.reset();
  const Report report = report_of(row.maps, row.edges);
  std::string page;
  write_report(report, "<!--CAIRN:TITLE--><!--CAIRN:DATA-->",
               [&](std::string_view text) { page += text; });
  EXPECT_THAT(page, HasSubstr("cairn-report"));
}

}  // namespace
}  // namespace cairn::report
