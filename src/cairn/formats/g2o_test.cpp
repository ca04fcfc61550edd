// SPDX-License-Identifier: BSD-3-Clause
#include <string>

#include <Eigen/Cholesky>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/core/random.hpp"
#include "cairn/formats/pose_graph_file.hpp"
#include "cairn/geometry/covariance.hpp"

#include "support/real_data.hpp"
#include "support/refusal.hpp"

namespace cairn {
namespace {

using ::testing::HasSubstr;

const std::string kIdentity21 = "1 0 0 0 0 0 1 0 0 0 0 1 0 0 0 1 0 0 1 0 1";
const std::string kTwo =
    "# two\nVERTEX_SE3:QUAT 1 0 0 0 0 0 0 1 \r\nVERTEX_SE3:QUAT 5 1 2 3 0 0 0.6 0.8\n\nFIX 1\n"
    "EDGE_SE3:QUAT 1 5 1 2 3 0 0 0.6 0.8 " +
    kIdentity21 + "\n";

TEST(G2o, IsKnownByItsFirstLine) {
  EXPECT_TRUE(is_g2o(kTwo));
  EXPECT_TRUE(is_g2o("\n  EDGE_SE3:QUAT 1"));
  EXPECT_TRUE(is_g2o("VERTEX_SE2 0 0 0 0\n")) << "reading it says what is not read";
  EXPECT_FALSE(is_g2o("# VERTEX_SE3:QUAT\n1 2 3\nFIX 1\n"));
  EXPECT_FALSE(is_g2o(""));
}

G2oGraph read_g2o_text(const std::string& text) {
  MemoryReader source(text, "a.g2o");
  return read_g2o(source);
}

std::string g2o_text(const G2oGraph& graph) {
  std::string text;
  write_g2o(graph, [&](std::string_view bytes) { text += bytes; });
  return text;
}

std::string complaint(const std::string& text) {
  return testing::refusal(ErrorKind::kInput, [&] { read_g2o_text(text); });
}

TEST(G2o, ReadsVerticesEdgesAndWhatIsFixed) {
  const G2oGraph graph = read_g2o_text(kTwo);
  ASSERT_EQ(graph.vertices.size(), 2U);
  EXPECT_EQ(graph.vertices[1].id, 5U);
  EXPECT_EQ(graph.vertices[1].translation, (std::array{1.0, 2.0, 3.0}));
  EXPECT_EQ(graph.vertices[1].quaternion, (std::array{0.0, 0.0, 0.6, 0.8}));
  EXPECT_EQ(graph.fixed, std::vector<std::uint64_t>{1});
  ASSERT_EQ(graph.edges.size(), 1U);
  EXPECT_EQ(graph.edges[0].information[20], 1.0);
  EXPECT_EQ(read_g2o_text(g2o_text(graph)), graph);
}

TEST(G2o, ReportsALastLineThatMayHaveBeenCutOff) {
  std::string loss;
  MemoryReader source("VERTEX_SE3:QUAT 1 0 0 0 0 0 0 1", "a.g2o");
  read_g2o(source, [&](const Remark& remark) { loss = remark.text; });
  EXPECT_THAT(loss, HasSubstr("a.g2o:1: the last line does not end"));
}

TEST(G2o, TakesQuaternionsWhoseNormIsWithinAHundredthOfOne) {
  EXPECT_EQ(read_g2o_text("VERTEX_SE3:QUAT 1 0 0 0 0 0 0 1.0099\n").vertices.size(), 1U);
  EXPECT_EQ(read_g2o_text("VERTEX_SE3:QUAT 1 0 0 0 0 0.9901 0 0\n").vertices.size(), 1U);
  EXPECT_THAT(complaint("VERTEX_SE3:QUAT 1 0 0 0 0 0 0 1.0101\n"), HasSubstr("within 1e-2"));
  EXPECT_THAT(complaint("VERTEX_SE3:QUAT 1 0 0 0 0 0.9899 0 0\n"), HasSubstr("within 1e-2"));
}

TEST(G2o, RefusesByLineAndField) {
  EXPECT_THAT(complaint(""), HasSubstr("a.g2o: no vertices"));
  EXPECT_THAT(complaint(kTwo + "VERTEX_SE2 1 0 0 0\n"),
              HasSubstr("a.g2o:7: field 1 (tag): 'VERTEX_SE2' is not read"));
  EXPECT_THAT(complaint("VERTEX_SE3:QUAT 1 0 x 0 0 0 0 1\n"),
              HasSubstr("a.g2o:1: field 4 (y): 'x' is not a number"));
  EXPECT_THAT(complaint("VERTEX_SE3:QUAT -1 0 0 0 0 0 0 1\n"), HasSubstr("field 2 (id): '-1'"));
  EXPECT_THAT(complaint("VERTEX_SE3:QUAT 1 0 0 0 0 0 0\n"), HasSubstr("field 9 (qw): missing"));
  EXPECT_THAT(complaint("VERTEX_SE3:QUAT 1 0 0 0 0 0 0 1 9\n"),
              HasSubstr("field 10: '9' is too much"));
  EXPECT_THAT(complaint("VERTEX_SE3:QUAT 1 0 0 0 0 0 0 2\n"), HasSubstr("quaternion of norm 2"));
  EXPECT_THAT(complaint("VERTEX_SE3:QUAT 1 0 0 nan 0 0 0 1\n"), HasSubstr("field 5 (z): 'nan'"));
  EXPECT_THAT(complaint(kTwo + "VERTEX_SE3:QUAT 5 0 0 0 0 0 0 1\n"),
              HasSubstr("a.g2o:7: field 2 (id): vertex 5 is in line 3 already"));
  EXPECT_THAT(complaint(kTwo + "FIX 6\n"), HasSubstr("a.g2o:7: there is no vertex 6"));
  EXPECT_THAT(complaint(kTwo + "EDGE_SE3:QUAT 1 4 0 0 0 0 0 0 1 " + kIdentity21 + "\n"),
              HasSubstr("a.g2o:7: there is no vertex 4"));
  EXPECT_THAT(complaint(kTwo + "EDGE_SE3:QUAT 1 1 0 0 0 0 0 0 1 " + kIdentity21 + "\n"),
              HasSubstr("with itself"));
  EXPECT_THAT(complaint(kTwo + "EDGE_SE3:QUAT 1 5 0 0 0 0 0 0 1 1 0\n"),
              HasSubstr("field 13 (information): missing"));
}

Rigid3 random_pose(Random& random) {
  const auto vector = [&] {
    return Eigen::Vector3d(random.normal(), random.normal(), random.normal());
  };
  const Eigen::Vector3d turn = vector();
  return {rotation_exp(turn), vector()};
}

PoseGraph random_graph(Random& random) {
  PoseGraph graph;
  graph.nodes = {{NodeId{10}, {}, {}, random_pose(random)},
                 {NodeId{11}, {}, {}, random_pose(random)}};
  Link link;
  link.target = NodeId{10};
  link.source = NodeId{11};
  link.target_from_source = random_pose(random);
  Matrix6d factor;
  for (int i = 0; i < 36; ++i) factor.data()[i] = random.normal();
  link.covariance = factor * factor.transpose() + 0.1 * Matrix6d::Identity();
  graph.links = {link};
  return graph;
}

TEST(G2o, RefusesCoordinatesBeyondTheLimit) {
  EXPECT_EQ(complaint("VERTEX_SE3:QUAT 1 0 1e9 0 0 0 0 1\n"), "");
  EXPECT_THAT(complaint("VERTEX_SE3:QUAT 1 0 -1.1e9 0 0 0 0 1\n"),
              HasSubstr("a.g2o:1: field 4 (y): -1.1e+09 is beyond the limit; expected numbers from "
                        "-1e9 to 1e9"));
}

TEST(G2o, KeepsAGraphThatIsConvertedBothWays) {
  Random random(1);
  const PoseGraph graph = random_graph(random);
  const PoseGraph back = pose_graph(read_g2o_text(g2o_text(g2o_graph(graph))));
  ASSERT_EQ(back.nodes.size(), 2U);
  ASSERT_EQ(back.links.size(), 1U);
  EXPECT_EQ(back.links[0].target, NodeId{10});
  EXPECT_EQ(back.links[0].kind, LinkKind::kOdometry);
  for (int i = 0; i < 2; ++i) {
    EXPECT_LT((back.nodes[i].world_from_node.matrix() - graph.nodes[i].world_from_node.matrix())
                  .cwiseAbs()
                  .maxCoeff(),
              1e-14);
  }
  EXPECT_LT((*back.links[0].covariance - *graph.links[0].covariance).cwiseAbs().maxCoeff(), 1e-10);
}

// g2o's own error of an edge, by its definition: translation, and the quaternion's vector part, of
// measured⁻¹·from⁻¹·to.
TEST(G2o, GivesAnErrorTheWeightThatG2oGivesIt) {
  Random random(2);
  for (int repeat = 0; repeat < 20; ++repeat) {
    const PoseGraph graph = random_graph(random);
    const Link& link = graph.links[0];
    const G2oGraph::Edge edge = g2o_graph(graph).edges[0];
    Vector6d step;
    for (int i = 0; i < 6; ++i) step[i] = 1e-4 * random.normal();
    const Rigid3 measured = link.target_from_source->rigid();
    const Rigid3 estimated = measured.perturbed(step);
    const Rigid3 error = measured.inverse() * estimated;
    Eigen::Quaterniond q = error.quaternion();
    if (q.w() < 0.0) q.coeffs() *= -1.0;
    Eigen::Matrix<double, 6, 1> e;
    e << error.translation(), q.vec();
    double squared = 0.0;
    std::size_t next = 0;
    for (int i = 0; i < 6; ++i) {
      for (int j = i; j < 6; ++j) {
        squared += (i == j ? 1.0 : 2.0) * edge.information[next++] * e[i] * e[j];
      }
    }
    // NOLINTNEXTLINE(readability-suspicious-call-argument): the estimate is in the place of the truth
    const double ours = normalised_squared_error(measured, *link.covariance, estimated);
    EXPECT_NEAR(squared / ours, 1.0, 1e-6);
  }
}

TEST(G2o, HasNoCovarianceWhereTheInformationHasNoInverse) {
  std::string text = kTwo;
  text.replace(text.rfind(kIdentity21), kIdentity21.size(),
               "1 0 0 0 0 0 1 0 0 0 0 0 0 0 0 1 0 0 1 0 1");
  EXPECT_FALSE(pose_graph(read_g2o_text(text)).links[0].covariance);
}

TEST(G2o, RefusesToWriteWhatItCannotHold) {
  Random random(3);
  PoseGraph graph = random_graph(random);
  graph.links[0].covariance.reset();
  EXPECT_THAT(testing::refusal(ErrorKind::kMisuse, [&] { g2o_graph(graph); }),
              HasSubstr("link 10 to 11: it has no covariance"));
  graph = random_graph(random);
  graph.nodes[1].world_from_node = Similarity3(2.0, Rigid3());
  EXPECT_THAT(testing::refusal(ErrorKind::kMisuse, [&] { g2o_graph(graph); }),
              HasSubstr("node 11: its scale is 2"));
}

// Counts by grep; of both graphs the first edges are odometry, which the vertices were chained from.
TEST(G2o, KeepsEveryNumberOfPublishedGraphs) {
  const auto data = testing::real_data();
  if (!data) GTEST_SKIP() << testing::kNoRealData;
  struct Published {
    const char* name;
    std::size_t vertices;
    std::size_t edges;
  };
  for (const auto& [name, vertices, edges] :
       {Published{"sphere2500.g2o", 2500, 4949}, {"parking-garage.g2o", 1661, 6275}}) {
    FileReader file(*data / "foreign" / "g2o" / name);
    const G2oGraph graph = read_g2o(file);
    EXPECT_EQ(graph.vertices.size(), vertices);
    EXPECT_EQ(graph.edges.size(), edges);
    EXPECT_EQ(read_g2o_text(g2o_text(graph)), graph) << name;
    const PoseGraph converted = pose_graph(graph);
    converted.validate();
    // Nothing is inverted: along odometry the poses agree with the links.
    const Link& first = converted.links.front();
    EXPECT_EQ(first.kind, LinkKind::kOdometry);
    const Rigid3 expected = converted.nodes[0].world_from_node.rigid().inverse() *
                            converted.nodes[1].world_from_node.rigid();
    EXPECT_EQ(first.target, converted.nodes[0].id);
    EXPECT_EQ(first.source, converted.nodes[1].id);
    EXPECT_LT(first.target_from_source->rigid().difference_to(expected).norm(), 0.1) << name;
    for (const Link& link : converted.links) EXPECT_TRUE(link.covariance) << name;
  }
}

}  // namespace
}  // namespace cairn
