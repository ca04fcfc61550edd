// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/merging/optimisation/optimise_poses.hpp"

#include <algorithm>
#include <functional>
#include <numeric>
#include <optional>
#include <utility>

#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/merging/detail/grown_poses.hpp"
#include "cairn/merging/detail/pose_edges.hpp"
#include "cairn/merging/detail/pose_least_squares.hpp"

namespace cairn {
namespace {

std::vector<std::size_t> indices_in(const PoseGroup& group, std::size_t nodes) {
  std::vector<std::size_t> in_group(nodes, kNoIndex);
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
    if (in_group[edge.target] == kNoIndex || in_group[edge.source] == kNoIndex) continue;
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
  const std::vector<PoseEdge> all = pose_edges(graph, extents);
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
        if (in_group[all[i].source] != kNoIndex) within.push_back(i);
      }
    }
    std::sort(within.begin(), within.end());
    std::vector<PoseEdge> edges;
    for (const std::size_t i : within) {
      const PoseEdge& edge = all[i];
      const std::size_t target = in_group[edge.target];
      const std::size_t source = in_group[edge.source];
      double variance = 0.0;
      if (!covariances.empty()) {
        for (const std::size_t node : {target, source}) {
          variance += mean_square_disagreement(covariances[node], group.group_from_node[node],
                                               extents[group.nodes[node]]);
        }
      }
      if (can_agree(edge, group.group_from_node[target], group.group_from_node[source], variance,
                    extents, options.agreement)) {
        edges.push_back(edge);
      }
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
  PoseGroup group =
      grow_groups(all, extents, session_numbers(graph), options.agreement, refine).front();
  std::vector<std::size_t> in_group = indices_in(group, count);
  const auto agrees = [&](const PoseEdge& edge) {
    const std::size_t target = in_group[edge.target];
    const std::size_t source = in_group[edge.source];
    if (target == kNoIndex || source == kNoIndex) return false;
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
  poses.tree = most_certain_tree(group.nodes.front(), edges, extents);
  return poses;
}

}  // namespace cairn
