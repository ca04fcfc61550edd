// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/merging/optimisation/optimise_poses.hpp"

#include <algorithm>
#include <functional>
#include <numeric>
#include <optional>
#include <tuple>
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

// The nodes in an order that does not depend on that of the input: the most extended first. What makes the poses of a
// group takes its nodes and links in this order.
struct SortedNodes {
  SortedNodes(const PoseGraph& graph, std::span<const NodeExtent> extents)
      : node(extents.size()), edges(pose_edges(graph, extents)) {
    std::iota(node.begin(), node.end(), std::size_t{0});
    std::stable_sort(node.begin(), node.end(), [&](std::size_t a, std::size_t b) {
      return extents[a].radius > extents[b].radius;
    });
    std::vector<std::size_t> rank(node.size());
    const std::vector<std::size_t> session = session_numbers(graph);
    for (std::size_t i = 0; i < node.size(); ++i) {
      rank[node[i]] = i;
      extent.push_back(extents[node[i]]);
      run.push_back(session[node[i]]);
    }
    for (PoseEdge& edge : edges) {
      edge.target = rank[edge.target];
      edge.source = rank[edge.source];
    }
    const auto key = [&](const PoseEdge& edge) {
      return std::tuple(edge.target, edge.source, mean_square_disagreement(edge, extent));
    };
    std::stable_sort(edges.begin(), edges.end(),
                     [&](const PoseEdge& a, const PoseEdge& b) { return key(a) < key(b); });
  }

  // The one of a group that comes first in the input, whose frame is the world.
  std::size_t first_of(const PoseGroup& group) const {
    return *std::min_element(group.nodes.begin(), group.nodes.end(),
                             [&](std::size_t a, std::size_t b) { return node[a] < node[b]; });
  }

  // Of the largest ones, that with the first node of the input.
  const PoseGroup& largest(const std::vector<PoseGroup>& groups) const {
    return *std::min_element(groups.begin(), groups.end(),
                             [&](const PoseGroup& a, const PoseGroup& b) {
                               if (a.nodes.size() != b.nodes.size())
                                 return a.nodes.size() > b.nodes.size();
                               return node[first_of(a)] < node[first_of(b)];
                             });
  }

  std::vector<std::size_t> node;  // index in the input
  std::vector<NodeExtent> extent;
  std::vector<std::size_t> run;
  std::vector<PoseEdge> edges;  // of these indices; sorted
};

// The parts of the group that the edges still connect.
std::vector<PoseGroup> connected_parts(const PoseGroup& group, const std::vector<PoseEdge>& edges,
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
  std::vector<PoseGroup> parts(root.size());
  for (std::size_t i = 0; i < root.size(); ++i) {
    PoseGroup& part = parts[find(i)];
    part.nodes.push_back(group.nodes[i]);
    part.group_from_node.push_back(group.group_from_node[i]);
  }
  std::erase_if(parts, [](const PoseGroup& part) { return part.nodes.empty(); });
  return parts;
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

OptimisedPoses optimise_poses(const PoseGraph& graph, std::span<const NodeExtent> given_extents,
                              const PoseOptimisationOptions& options) {
  options.validate();
  const SortedNodes sorted(graph, given_extents);
  const std::vector<PoseEdge>& all = sorted.edges;
  const std::span<const NodeExtent> extents = sorted.extent;
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
      sorted.largest(grow_groups(all, extents, sorted.run, options.agreement, refine));
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
    group = sorted.largest(connected_parts(group, edges, in_group));
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

  const std::size_t frame = sorted.first_of(group);
  std::vector<Matrix7d> covariances;
  if (group.nodes.front() == frame) {
    covariances = covariances_of(edges);
  } else {
    // Relative to the frame's node, so that this one is fixed.
    std::swap(group.nodes.front(), group.nodes[in_group[frame]]);
    std::swap(group.group_from_node.front(), group.group_from_node[in_group[frame]]);
    in_group = indices_in(group, count);
    begin_at_first();
    covariances = least_squares(edges, group, in_group).covariances();
  }
  poses.world_from_node.assign(count, std::nullopt);
  poses.covariances.assign(count, Matrix7d::Zero());
  poses.agrees.assign(graph.links.size(), false);
  for (std::size_t i = 0; i < group.nodes.size(); ++i) {
    poses.world_from_node[sorted.node[group.nodes[i]]] = group.group_from_node[i];
    poses.covariances[sorted.node[group.nodes[i]]] = covariances[i];
  }
  for (const PoseEdge& edge : edges) poses.agrees[edge.link] = agrees(edge);
  poses.tree = most_certain_tree(frame, edges, extents);
  return poses;
}

}  // namespace cairn
