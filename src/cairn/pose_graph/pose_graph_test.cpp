// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/pose_graph/pose_graph.hpp"

#include <limits>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "support/refusal.hpp"

namespace cairn {
namespace {

using ::testing::HasSubstr;

PoseGraph two_nodes() {
  PoseGraph graph;
  graph.nodes = {{NodeId{3}, "a", "one", {}}, {NodeId{7}, "b", "two", {}}};
  Link link;
  link.target = NodeId{3};
  link.source = NodeId{7};
  link.target_from_source = Similarity3();
  link.covariance = Matrix6d::Identity();
  link.probability = 0.5;
  graph.links = {link};
  return graph;
}

std::string complaint(const PoseGraph& graph) {
  return testing::refusal(ErrorKind::kInput, [&] { graph.validate("g"); });
}

TEST(PoseGraph, RefusesWhatBreaksItsRules) {
  EXPECT_EQ(complaint(two_nodes()), "");
  PoseGraph graph = two_nodes();
  graph.nodes[1].id = NodeId{3};
  EXPECT_THAT(complaint(graph), HasSubstr("g: node 3: its id occurs twice"));
  graph = two_nodes();
  graph.links[0].source = NodeId{8};
  EXPECT_THAT(complaint(graph), HasSubstr("link 0 (3 to 8): there is no node 8"));
  graph.links[0].source = NodeId{3};
  EXPECT_THAT(complaint(graph), HasSubstr("with itself"));
  graph = two_nodes();
  graph.links[0].verdict = Verdict::kAmbiguous;
  EXPECT_THAT(complaint(graph), HasSubstr("link 0 (3 to 7): it does not connect them"));
  graph = two_nodes();
  graph.links[0].target_from_source.reset();
  EXPECT_THAT(complaint(graph), HasSubstr("it does not connect them"));
  graph = two_nodes();
  (*graph.links[0].covariance)(0, 1) = 0.5;
  EXPECT_THAT(complaint(graph), HasSubstr("not symmetric"));
  graph = two_nodes();
  (*graph.links[0].covariance)(5, 5) = -1.0;
  EXPECT_THAT(complaint(graph), HasSubstr("indefinite"));
  graph = two_nodes();
  graph.links[0].covariance_with_scale = Matrix7d::Identity();
  (*graph.links[0].covariance_with_scale)(6, 6) = -1.0;
  EXPECT_THAT(complaint(graph), HasSubstr("indefinite"));
  graph = two_nodes();
  graph.links[0].probability = 1.5;
  EXPECT_THAT(complaint(graph), HasSubstr("its probability is 1.5; expected 0 to 1"));
  graph = two_nodes();
  graph.nodes[0].world_from_node =
      Rigid3(Eigen::Quaterniond::Identity(),
             Eigen::Vector3d(std::numeric_limits<double>::infinity(), 0.0, 0.0));
  EXPECT_THAT(complaint(graph), HasSubstr("node 3: its pose is not finite"));
}

TEST(PoseGraph, RefusesPosesBeyondTheLimits) {
  const auto pose = [](double scale, double x) {
    return Similarity3(scale, Rigid3(Eigen::Quaterniond::Identity(), {x, 0.0, 0.0}));
  };
  for (const Similarity3& valid : {pose(1e9, -1e9), pose(1e-9, 1e9)}) {
    PoseGraph graph = two_nodes();
    graph.nodes[0].world_from_node = valid;
    graph.links[0].target_from_source = valid;
    EXPECT_EQ(complaint(graph), "");
  }
  for (const Similarity3& invalid : {pose(1.0, 1e30), pose(1e200, 0.0), pose(1e-10, 0.0)}) {
    PoseGraph graph = two_nodes();
    graph.nodes[0].world_from_node = invalid;
    EXPECT_THAT(complaint(graph), HasSubstr("g: node 3: its pose is beyond the limit"));
    graph = two_nodes();
    graph.links[0].target_from_source = invalid;
    EXPECT_THAT(complaint(graph), HasSubstr("(3 to 7): its transform is beyond the limit"));
  }
}

}  // namespace
}  // namespace cairn
