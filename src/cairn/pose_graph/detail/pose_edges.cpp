// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/pose_graph/detail/pose_edges.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <queue>
#include <string>
#include <tuple>

#include <Eigen/Cholesky>
#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/geometry/covariance.hpp"
#include "cairn/pose_graph/detail/pose_least_squares.hpp"

namespace cairn::detail {
namespace {

// No link is more exact than a millionth of what it moves, or the normal equations would be ill-conditioned.
constexpr double kExact = 1e-6;

}  // namespace

void check_graph(const PoseGraph& graph, std::span<const NodeExtent> extents) {
  graph.validate();
  refuse_if(extents.size() != graph.nodes.size(), "extents",
            fmt::format("{} of them", extents.size()),
            fmt::format("{}, one a node", graph.nodes.size()));
  for (const NodeExtent& extent : extents) {
    if (!(extent.radius > 0.0) || !std::isfinite(extent.radius)) {
      throw Error(ErrorKind::kMisuse, "NodeExtent.radius", fmt::format("{}", extent.radius),
                  "a positive finite number");
    }
  }
}

std::vector<std::pair<std::size_t, std::size_t>> link_ends(const PoseGraph& graph) {
  std::vector<std::pair<NodeId, std::size_t>> by_id;
  for (std::size_t i = 0; i < graph.nodes.size(); ++i) by_id.emplace_back(graph.nodes[i].id, i);
  std::sort(by_id.begin(), by_id.end());
  const auto index_of = [&](NodeId id) {
    return std::lower_bound(by_id.begin(), by_id.end(), std::pair(id, std::size_t{0}))->second;
  };
  std::vector<std::pair<std::size_t, std::size_t>> ends;
  for (const Link& link : graph.links)
    ends.emplace_back(index_of(link.target), index_of(link.source));
  return ends;
}

std::vector<PoseEdge> pose_edges(const PoseGraph& graph, std::span<const NodeExtent> extents) {
  check_graph(graph, extents);
  const auto ends = link_ends(graph);
  std::vector<PoseEdge> edges;
  for (std::size_t i = 0; i < graph.links.size(); ++i) {
    const Link& link = graph.links[i];
    PoseEdge edge{i, ends[i].first, ends[i].second, *link.target_from_source, {}};
    const std::optional<Matrix7d> covariance = link.full_covariance();
    if (!covariance) continue;
    edge.covariance = *covariance;
    if (!link.covariance_with_scale) edge.covariance(6, 6) = kSameScale * kSameScale;
    const double length = kExact * extents[edge.source].radius * edge.target_from_source.scale();
    for (int k = 0; k < 7; ++k) edge.covariance(k, k) += k < 3 ? length * length : kExact * kExact;
    if (Eigen::LLT<Eigen::Matrix<double, 7, 7>>(edge.covariance).info() == Eigen::Success)
      edges.push_back(edge);
  }
  return edges;
}

std::vector<std::size_t> session_numbers(const PoseGraph& graph) {
  std::map<std::string, std::size_t> numbers;
  std::vector<std::size_t> result;
  for (std::size_t i = 0; i < graph.nodes.size(); ++i) {
    const std::string& session = graph.nodes[i].session;
    result.push_back(session.empty() ? i : numbers.try_emplace(session, i).first->second);
  }
  return result;
}

double disagreement(const Similarity3& a, const Similarity3& b, const NodeExtent& extent) {
  const double radius = a.scale() * extent.radius;
  const double shift = (a * extent.centre - b * extent.centre).norm() / radius;
  const double turn = (a.rigid().inverse() * b.rigid()).angle();
  const double growth = std::log(b.scale() / a.scale());
  return std::sqrt(shift * shift + turn * turn + growth * growth);
}

double mean_square_shift(const Matrix7d& covariance, const Similarity3& pose,
                         const NodeExtent& extent) {
  const Eigen::Matrix<double, 3, 7> by_pose = point_by_pose(pose.linear() * extent.centre);
  return (by_pose * covariance * by_pose.transpose()).trace();
}

double mean_square_disagreement(const Matrix7d& c, const Similarity3& pose,
                                const NodeExtent& extent) {
  const double radius = extent.radius * pose.scale();
  return mean_square_shift(c, pose, extent) / (radius * radius) + c(3, 3) + c(4, 4) + c(5, 5) +
         c(6, 6);
}

double mean_square_disagreement(const PoseEdge& edge, std::span<const NodeExtent> extents) {
  return mean_square_disagreement(edge.covariance, edge.target_from_source, extents[edge.source]);
}

bool can_agree(const PoseEdge& edge, const Similarity3& target, const Similarity3& source,
               double variance, std::span<const NodeExtent> extents, double agreement) {
  constexpr double kDeviations = 3.0;
  variance += mean_square_disagreement(edge, extents);
  return disagreement(target * edge.target_from_source, source, extents[edge.source]) <=
         agreement + kDeviations * std::sqrt(variance);
}

std::vector<std::size_t> most_certain_tree(std::size_t root, std::span<const PoseEdge> edges,
                                           std::span<const NodeExtent> extents) {
  using Entry =
      std::tuple<double, std::size_t, std::size_t, std::size_t>;  // variance, link, edge, node
  std::vector<std::vector<std::size_t>> edges_at(extents.size());
  for (std::size_t i = 0; i < edges.size(); ++i) {
    edges_at[edges[i].target].push_back(i);
    edges_at[edges[i].source].push_back(i);
  }
  std::vector<bool> reached(extents.size(), false);
  std::priority_queue<Entry, std::vector<Entry>, std::greater<>> queue;
  std::vector<std::size_t> tree;
  const auto reach = [&](std::size_t node) {
    reached[node] = true;
    for (const std::size_t i : edges_at[node]) {
      const PoseEdge& edge = edges[i];
      const std::size_t other = edge.target + edge.source - node;
      if (reached[other]) continue;
      queue.emplace(mean_square_disagreement(edge, extents), edge.link, i, other);
    }
  };
  reach(root);
  while (!queue.empty()) {
    const auto [variance, link, edge, node] = queue.top();
    queue.pop();
    if (reached[node]) continue;
    tree.push_back(link);
    reach(node);
  }
  return tree;
}

}  // namespace cairn::detail
