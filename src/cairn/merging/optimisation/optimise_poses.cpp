// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/merging/optimisation/optimise_poses.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <numeric>
#include <optional>
#include <queue>
#include <string>
#include <tuple>
#include <utility>

#include <Eigen/Cholesky>
#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/merging/detail/grown_poses.hpp"
#include "cairn/merging/detail/pose_least_squares.hpp"

namespace cairn {
namespace {

using Matrix7 = Eigen::Matrix<double, 7, 7>;

constexpr std::size_t kNone = static_cast<std::size_t>(-1);
// Least standard deviation of a link, relative to the extent of the map it moves, for numerical stability.
constexpr double kExact = 1e-6;

std::vector<PoseEdge> edges_of(const PoseGraph& graph, std::span<const NodeExtent> extents) {
  std::vector<std::pair<NodeId, std::size_t>> by_id;
  for (std::size_t i = 0; i < graph.nodes.size(); ++i) by_id.emplace_back(graph.nodes[i].id, i);
  std::sort(by_id.begin(), by_id.end());
  const auto index_of = [&](NodeId id) {
    return std::lower_bound(by_id.begin(), by_id.end(), std::pair(id, std::size_t{0}))->second;
  };
  std::vector<PoseEdge> edges;
  for (std::size_t i = 0; i < graph.links.size(); ++i) {
    const PoseLink& link = graph.links[i];
    PoseEdge edge{i, index_of(link.target), index_of(link.source), link.target_from_source, {}};
    if (link.covariance_with_scale) {
      edge.covariance = *link.covariance_with_scale;
    } else if (link.covariance) {
      edge.covariance.setZero();
      edge.covariance.topLeftCorner<6, 6>() = *link.covariance;
      edge.covariance(6, 6) = kSameScale * kSameScale;
    } else {
      continue;
    }
    const double length = kExact * extents[edge.source].radius * edge.target_from_source.scale();
    for (int k = 0; k < 7; ++k) edge.covariance(k, k) += k < 3 ? length * length : kExact * kExact;
    if (Eigen::LLT<Matrix7>(edge.covariance).info() == Eigen::Success) edges.push_back(edge);
  }
  return edges;
}

// Mean squared displacement of a pose's landmarks for this covariance, in radii.
double variance_of(const Matrix7d& c, double radius) {
  return (c(0, 0) + c(1, 1) + c(2, 2)) / (radius * radius) + c(3, 3) + c(4, 4) + c(5, 5) + c(6, 6);
}

// Number of each node's session; a node without a session has its own.
std::vector<std::size_t> runs_of(const PoseGraph& graph) {
  std::map<std::string, std::size_t> numbers;
  std::vector<std::size_t> runs;
  for (std::size_t i = 0; i < graph.nodes.size(); ++i) {
    const std::string& session = graph.nodes[i].session;
    runs.push_back(session.empty() ? i : numbers.try_emplace(session, i).first->second);
  }
  return runs;
}

std::vector<std::size_t> indices_in(const PoseGroup& group, std::size_t nodes) {
  std::vector<std::size_t> in_group(nodes, kNone);
  for (std::size_t i = 0; i < group.nodes.size(); ++i) in_group[group.nodes[i]] = i;
  return in_group;
}

// The edges' errors as a function of the group's poses.
PoseLeastSquares least_squares(std::vector<PoseEdge> edges, const PoseGroup& group,
                               const std::vector<std::size_t>& in_group) {
  for (PoseEdge& edge : edges) {
    edge.target = in_group[edge.target];
    edge.source = in_group[edge.source];
  }
  return {std::move(edges), group.group_from_node};
}

// The largest part of the group that the edges still connect.
PoseGroup largest_part(const PoseGroup& group, const std::vector<PoseEdge>& edges,
                       const std::vector<std::size_t>& in_group) {
  std::vector<std::size_t> root(group.nodes.size());
  std::iota(root.begin(), root.end(), std::size_t{0});
  const auto find = [&](std::size_t node) {
    while (root[node] != node) node = root[node] = root[root[node]];
    return node;
  };
  for (const PoseEdge& edge : edges) {
    if (in_group[edge.target] == kNone || in_group[edge.source] == kNone) continue;
    const std::size_t a = find(in_group[edge.target]);
    const std::size_t b = find(in_group[edge.source]);
    root[std::max(a, b)] = std::min(a, b);
  }
  std::vector<std::size_t> sizes(root.size(), 0);
  for (std::size_t i = 0; i < root.size(); ++i) ++sizes[find(i)];
  const auto largest =
      static_cast<std::size_t>(std::max_element(sizes.begin(), sizes.end()) - sizes.begin());
  PoseGroup part;
  for (std::size_t i = 0; i < root.size(); ++i) {
    if (find(i) != largest) continue;
    part.nodes.push_back(group.nodes[i]);
    part.group_from_node.push_back(group.group_from_node[i]);
  }
  return part;
}

// The edges that lead from the group's first node to all others, the most certain first.
std::vector<std::size_t> tree_of(const PoseGroup& group, const std::vector<PoseEdge>& edges,
                                 const std::vector<std::size_t>& in_group,
                                 std::span<const NodeExtent> extents) {
  using Entry = std::tuple<double, std::size_t, std::size_t>;  // variance, edge, node
  std::vector<std::vector<std::size_t>> at(group.nodes.size());
  for (std::size_t i = 0; i < edges.size(); ++i) {
    if (in_group[edges[i].target] == kNone || in_group[edges[i].source] == kNone) continue;
    at[in_group[edges[i].target]].push_back(i);
    at[in_group[edges[i].source]].push_back(i);
  }
  std::vector<bool> placed(group.nodes.size(), false);
  std::priority_queue<Entry, std::vector<Entry>, std::greater<>> queue;
  std::vector<std::size_t> tree;
  const auto place = [&](std::size_t node) {
    placed[node] = true;
    for (const std::size_t i : at[node]) {
      const std::size_t other = in_group[edges[i].target] + in_group[edges[i].source] - node;
      if (!placed[other])
        queue.emplace(variance_of(edges[i].covariance, edges[i].target_from_source.scale() *
                                                           extents[edges[i].source].radius),
                      i, other);
    }
  };
  place(0);
  while (!queue.empty()) {
    const auto [variance, edge, node] = queue.top();
    queue.pop();
    if (placed[node]) continue;
    tree.push_back(edges[edge].link);
    place(node);
  }
  return tree;
}

}  // namespace

void PoseOptimisationOptions::validate() const {
  if (!(agreement > 0.0 && agreement <= 1.0)) {
    throw Error(ErrorKind::kMisuse, "PoseOptimisationOptions.agreement",
                fmt::format("{}", agreement), "above 0, at most 1");
  }
  if (max_iterations < 1) {
    throw Error(ErrorKind::kMisuse, "PoseOptimisationOptions.max_iterations",
                fmt::format("{}", max_iterations), "at least 1");
  }
}

OptimisedPoses optimise_poses(const PoseGraph& graph, std::span<const NodeExtent> extents,
                              const PoseOptimisationOptions& options) {
  options.validate();
  graph.validate();
  if (extents.size() != graph.nodes.size()) {
    throw Error(ErrorKind::kMisuse, "extents", fmt::format("{} of them", extents.size()),
                fmt::format("{}, one a node", graph.nodes.size()));
  }
  for (const NodeExtent& extent : extents) {
    if (!(extent.radius > 0.0) || !std::isfinite(extent.radius)) {
      throw Error(ErrorKind::kMisuse, "NodeExtent.radius", fmt::format("{}", extent.radius),
                  "a positive finite number");
    }
  }
  const std::vector<PoseEdge> all = edges_of(graph, extents);
  OptimisedPoses poses;
  if (graph.nodes.empty()) return poses;
  const std::size_t count = graph.nodes.size();
  std::vector<std::vector<std::size_t>> edges_to(count);
  for (std::size_t i = 0; i < all.size(); ++i) edges_to[all[i].target].push_back(i);
  // Edges that may agree with the poses of a group, within the covariances of the edges and, if given, of the
  // poses. The others would hardly change the poses, but slow down the solver.
  const auto possible = [&](const PoseGroup& group, const std::vector<std::size_t>& in_group,
                            const std::vector<Matrix7d>& covariances) {
    std::vector<std::size_t> within;
    for (const std::size_t node : group.nodes) {
      for (const std::size_t i : edges_to[node]) {
        if (in_group[all[i].source] != kNone) within.push_back(i);
      }
    }
    std::sort(within.begin(), within.end());
    std::vector<PoseEdge> edges;
    for (const std::size_t i : within) {
      const PoseEdge& edge = all[i];
      const std::size_t target = in_group[edge.target];
      const std::size_t source = in_group[edge.source];
      double variance = variance_of(edge.covariance,
                                    extents[edge.source].radius * edge.target_from_source.scale());
      if (!covariances.empty()) {
        for (const std::size_t node : {target, source}) {
          const Similarity3& pose = group.group_from_node[node];
          variance +=
              variance_of(covariances[node], extents[group.nodes[node]].radius * pose.scale());
        }
      }
      const double far = disagreement(group.group_from_node[target] * edge.target_from_source,
                                      group.group_from_node[source], extents[edge.source]);
      constexpr double kDeviations = 3.0;
      if (far <= options.agreement + kDeviations * std::sqrt(variance)) edges.push_back(edge);
    }
    return edges;
  };
  const auto refine = [&](PoseGroup& group) {
    constexpr int kIterations = 10;
    constexpr double kTolerance = 1e-4;
    const std::vector<std::size_t> in_group = indices_in(group, count);
    PoseLeastSquares problem = least_squares(possible(group, in_group, {}), group, in_group);
    problem.solve(kIterations, kTolerance);
    group.group_from_node = problem.poses();
  };
  PoseGroup group = grow_groups(all, extents, runs_of(graph), options.agreement, refine).front();
  std::vector<std::size_t> in_group = indices_in(group, count);
  const auto agrees = [&](const PoseEdge& edge) {
    const std::size_t target = in_group[edge.target];
    const std::size_t source = in_group[edge.source];
    if (target == kNone || source == kNone) return false;
    return disagreement(group.group_from_node[target] * edge.target_from_source,
                        group.group_from_node[source], extents[edge.source]) <= options.agreement;
  };
  const auto begin_at_first = [&] {
    const Similarity3 first_from_group = group.group_from_node.front().inverse();
    for (Similarity3& pose : group.group_from_node) pose = first_from_group * pose;
    group.group_from_node.front() = Similarity3();
  };
  // Keeps the last problem whose covariances were computed, with its factor, because edges added to it are
  // often removed again.
  struct Kept {
    std::vector<std::size_t> links;
    PoseLeastSquares problem;
    std::vector<Matrix7d> covariances;
  };
  std::optional<Kept> kept;
  const auto is_kept = [&](const std::vector<PoseEdge>& edges) {
    return kept && kept->problem.poses().size() == group.nodes.size() &&
           std::equal(edges.begin(), edges.end(), kept->links.begin(), kept->links.end(),
                      [](const PoseEdge& edge, std::size_t link) { return edge.link == link; });
  };
  const auto solve = [&](const std::vector<PoseEdge>& edges, double tolerance) {
    std::optional<PoseLeastSquares> other;
    if (!is_kept(edges)) other = least_squares(edges, group, in_group);
    PoseLeastSquares& problem = other ? *other : kept->problem;
    problem.solve(options.max_iterations, tolerance);
    group.group_from_node = problem.poses();
  };
  const auto covariances_of = [&](const std::vector<PoseEdge>& edges) {
    if (!is_kept(edges)) {
      kept.emplace(Kept{{}, least_squares(edges, group, in_group), {}});
      for (const PoseEdge& edge : edges) kept->links.push_back(edge.link);
      kept->covariances = kept->problem.covariances();
    }
    return kept->covariances;
  };
  const auto keep_connected = [&](std::vector<PoseEdge>& edges) {
    std::erase_if(edges, [&](const PoseEdge& edge) { return !agrees(edge); });
    const std::size_t first = group.nodes.front();
    group = largest_part(group, edges, in_group);
    in_group = indices_in(group, count);
    if (group.nodes.front() != first) begin_at_first();
    std::erase_if(edges, [&](const PoseEdge& edge) { return !agrees(edge); });
  };
  // Optimises the poses by the edges that agree with them, then by all that may agree given the poses'
  // covariances. Removes edges that disagree with the result, and nodes that only these connect, until all
  // edges agree.
  begin_at_first();
  std::vector<PoseEdge> edges = possible(group, in_group, {});
  solve(edges, 1e-9);
  keep_connected(edges);
  edges = possible(group, in_group, covariances_of(edges));
  for (std::size_t before = edges.size() + 1; edges.size() < before;) {
    before = edges.size();
    solve(edges, 1e-12);
    keep_connected(edges);
  }

  const std::vector<Matrix7d> covariances = covariances_of(edges);
  poses.world_from_node.assign(count, std::nullopt);
  poses.covariances.assign(count, Matrix7d::Zero());
  poses.agrees.assign(graph.links.size(), false);
  for (std::size_t i = 0; i < group.nodes.size(); ++i) {
    poses.world_from_node[group.nodes[i]] = group.group_from_node[i];
    poses.covariances[group.nodes[i]] = covariances[i];
  }
  for (const PoseEdge& edge : edges) poses.agrees[edge.link] = agrees(edge);
  poses.tree = tree_of(group, edges, in_group, extents);
  return poses;
}

}  // namespace cairn
