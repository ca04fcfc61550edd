// SPDX-License-Identifier: BSD-3-Clause
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/core/random.hpp"
#include "cairn/formats/pose_graph_file.hpp"

#include "support/refusal.hpp"

namespace cairn {
namespace {

using ::testing::HasSubstr;

TEST(PoseGraphJson, IsKnownByItsBeginning) {
  EXPECT_TRUE(is_pose_graph_text(pose_graph_text({})));
  EXPECT_FALSE(is_pose_graph_text("{\"schema\": {\"name\": \"cairn.align\"}}"));
  EXPECT_FALSE(is_pose_graph_text("\"cairn.pose_graph\""));
  EXPECT_FALSE(is_pose_graph_text(""));
}

PoseGraph example() {
  Random random(4);
  const auto pose = [&](double scale) {
    const Eigen::Vector3d turn(random.normal(), random.normal(), random.normal());
    return Similarity3(scale, {rotation_exp(turn), {random.normal(), 1e-300, -0.0}});
  };
  PoseGraph graph;
  graph.nodes = {{NodeId{18446744073709551615U}, "monday \"é\"\n", "s", pose(1.0)},
                 {NodeId{2}, "", "", pose(1.0 / 3.0)},
                 {NodeId{3}, "c", "t", pose(7e5)}};
  Link link;
  link.target = NodeId{18446744073709551615U};
  link.source = NodeId{2};
  link.target_from_source = pose(2.0);
  Matrix7d factor;
  for (int i = 0; i < 49; ++i) factor.data()[i] = random.normal();
  const Matrix7d covariance = factor * factor.transpose();
  link.covariance_with_scale = 0.5 * (covariance + covariance.transpose());
  link.covariance = Matrix6d(link.covariance_with_scale->topLeftCorner<6, 6>());
  link.kind = LinkKind::kPlacement;
  link.probability = 0.1 + 0.2;
  graph.links = {link,
                 {.target = NodeId{2},
                  .source = NodeId{3},
                  .kind = LinkKind::kManual,
                  .target_from_source = pose(1.0)}};
  return graph;
}

PoseGraph read_graph(const std::string& text) {
  MemoryReader source(text, "a.json");
  return read_pose_graph(source);
}

void expect_same(const Similarity3& a, const Similarity3& b) {
  EXPECT_EQ(a.scale(), b.scale());
  EXPECT_EQ(a.translation(), b.translation());
  EXPECT_LT((a.rigid().quaternion().coeffs() - b.rigid().quaternion().coeffs()).norm(), 4e-16);
}

TEST(PoseGraphJson, IsReadAsItWasWritten) {
  const PoseGraph graph = example();
  const PoseGraph back = read_graph(pose_graph_text(graph));
  ASSERT_EQ(back.nodes.size(), graph.nodes.size());
  for (std::size_t i = 0; i < graph.nodes.size(); ++i) {
    EXPECT_EQ(back.nodes[i].id, graph.nodes[i].id);
    EXPECT_EQ(back.nodes[i].name, graph.nodes[i].name);
    EXPECT_EQ(back.nodes[i].session, graph.nodes[i].session);
    expect_same(back.nodes[i].world_from_node, graph.nodes[i].world_from_node);
  }
  ASSERT_EQ(back.links.size(), graph.links.size());
  for (std::size_t i = 0; i < graph.links.size(); ++i) {
    EXPECT_EQ(back.links[i].target, graph.links[i].target);
    EXPECT_EQ(back.links[i].source, graph.links[i].source);
    expect_same(back.links[i].target_from_source.value(), *graph.links[i].target_from_source);
    EXPECT_EQ(back.links[i].covariance, graph.links[i].covariance);
    EXPECT_EQ(back.links[i].covariance_with_scale, graph.links[i].covariance_with_scale);
    EXPECT_EQ(back.links[i].kind, graph.links[i].kind);
    EXPECT_EQ(back.links[i].probability, graph.links[i].probability);
  }
}

TEST(PoseGraphJson, RefusesNamingThePlace) {
  const std::string good = pose_graph_text(example());
  const auto complaint = [&](const std::string& from, const std::string& to) {
    std::string text = good;
    const std::size_t found = text.find(from);
    EXPECT_NE(found, std::string::npos) << from;
    text.replace(found, from.size(), to);
    return testing::refusal(ErrorKind::kInput, [&] { read_graph(text); });
  };
  EXPECT_THAT(complaint("\"nodes\": [", "\"nodes\": [ oops"), HasSubstr(": is not JSON"));
  EXPECT_THAT(complaint("cairn.pose_graph", "cairn.align"),
              HasSubstr("a.json: /schema/name: 'cairn.align'; expected cairn.pose_graph"));
  EXPECT_THAT(complaint("\"version\": 1", "\"version\": 2"),
              HasSubstr("/schema/version: 2; expected 1"));
  EXPECT_THAT(complaint("\"id\": 2", "\"id\": -2"), HasSubstr("/nodes/1/id: is no whole number"));
  EXPECT_THAT(complaint("\"id\": 2", "\"it\": 2"), HasSubstr("/nodes/1: has no 'id'"));
  EXPECT_THAT(complaint("\"scale\": 1.0", "\"scale\": 0"),
              HasSubstr("/nodes/0/world_from_node/scale: 0; expected a positive number"));
  EXPECT_THAT(complaint("\"quaternion\": [", "\"quaternion\": [ 1,"),
              HasSubstr("has 5 entries; expected 4 numbers"));
  EXPECT_THAT(complaint("\"manual\"", "\"guess\""),
              HasSubstr("/links/1/kind: 'guess'; expected odometry"));
  EXPECT_THAT(complaint("\"source\": 3", "\"source\": 4"), HasSubstr("there is no node 4"));
  EXPECT_THAT(complaint("\"probability\": 0.3", "\"probability\": 5.3"),
              HasSubstr("expected 0 to 1"));
}

TEST(PoseGraphJson, ManyKeysTakeNoQuadraticTime) {
  std::string text = pose_graph_text(example());
  std::string keys = "{";
  for (int i = 0; i < 100'000; ++i) keys += "\"key " + std::to_string(i) + "\": 0, ";
  text.replace(text.find('{'), 1, keys);
  EXPECT_EQ(read_graph(text).nodes.size(), example().nodes.size());
}

TEST(PoseGraphJson, RefusesWhatIsNestedTooDeep) {
  const std::string text = std::string(200'000, '[') + std::string(200'000, ']');
  EXPECT_THAT(testing::refusal(ErrorKind::kInput, [&] { read_graph(text); }),
              HasSubstr("a.json: byte 100: lists and objects are nested too deeply"));
}

}  // namespace
}  // namespace cairn
