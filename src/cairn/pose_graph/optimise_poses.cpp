// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/pose_graph/optimise_poses.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <tuple>
#include <utility>

#include "cairn/core/detail/disjoint_sets.hpp"
#include "cairn/core/statistics.hpp"
#include "cairn/pose_graph/detail/grown_poses.hpp"
#include "cairn/pose_graph/detail/pose_edges.hpp"
#include "cairn/pose_graph/detail/pose_least_squares.hpp"

namespace cairn {

using namespace detail;  // what the solver is made of

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
  DisjointSets sets(group.nodes.size());
  for (const PoseEdge& edge : edges) {
    if (in_group[edge.target] == kNoIndex || in_group[edge.source] == kNoIndex) continue;
    sets.join(in_group[edge.target], in_group[edge.source]);
  }
  std::vector<PoseGroup> parts(group.nodes.size());
  for (std::size_t i = 0; i < parts.size(); ++i) {
    PoseGroup& part = parts[sets.first_of(i)];
    part.nodes.push_back(group.nodes[i]);
    part.group_from_node.push_back(group.group_from_node[i]);
  }
  std::erase_if(parts, [](const PoseGroup& part) { return part.nodes.empty(); });
  return parts;
}

// Poses of the largest group of a graph.
class GroupOptimisation {
 public:
  GroupOptimisation(const PoseGraph& graph, std::span<const NodeExtent> extents,
                    const PoseOptimisationOptions& options)
      : sorted_(graph, extents), options_(options), edges_to_(extents.size()) {
    for (std::size_t i = 0; i < sorted_.edges.size(); ++i) {
      edges_to_[sorted_.edges[i].target].push_back(i);
    }
    set_group(
        sorted_.largest(grow_groups(sorted_.edges, sorted_.extent, sorted_.run, options.agreement,
                                    [this](PoseGroup& group) { refine(group); })));
  }

  // Optimises the poses by the edges that agree with them, then by all that may agree given the poses' covariances.
  // Removes edges that disagree with the result, and nodes that only these connect, until all edges agree.
  void run() {
    begin_at_first();
    edges_ = possible(group_, in_group_, {});
    solve(1e-9);
    keep_connected();
    edges_ = possible(group_, in_group_, covariances());
    for (std::size_t before = edges_.size() + 1; edges_.size() < before;) {
      before = edges_.size();
      solve(1e-12);
      keep_connected();
    }
  }

  /// @param links number of the graph's
  OptimisedPoses result(std::size_t links) {
    const std::size_t frame = sorted_.first_of(group_);
    const std::vector<Matrix7d> covariances = covariances_relative_to(frame);
    const std::size_t count = sorted_.node.size();
    OptimisedPoses poses;
    poses.world_from_node.assign(count, std::nullopt);
    poses.covariances.assign(count, Matrix7d::Zero());
    poses.agrees.assign(links, false);
    for (std::size_t i = 0; i < group_.nodes.size(); ++i) {
      const std::size_t node = sorted_.node[group_.nodes[i]];
      poses.world_from_node[node] = group_.group_from_node[i];
      poses.covariances[node] = covariances[i];
    }
    for (const PoseEdge& edge : edges_) poses.agrees[edge.link] = agrees(edge);
    poses.tree = most_certain_tree(frame, edges_, sorted_.extent);
    return poses;
  }

 private:
  // The last problem whose covariances were computed, with its factor: edges added to it are often removed again.
  struct Kept {
    std::vector<std::size_t> links;
    PoseLeastSquares problem;
    std::vector<Matrix7d> covariances;  // at its poses; empty if these moved since
  };

  void set_group(PoseGroup group) {
    group_ = std::move(group);
    in_group_ = indices_in(group_, sorted_.node.size());
  }

  // Edges that may agree with the poses of a group, within the covariances of the edges and, if given, of the poses. The
  // others would hardly change the poses, but slow down the solver.
  std::vector<PoseEdge> possible(const PoseGroup& group, const std::vector<std::size_t>& in_group,
                                 const std::vector<Matrix7d>& covariances) const {
    std::vector<std::size_t> within;
    for (const std::size_t node : group.nodes) {
      for (const std::size_t i : edges_to_[node]) {
        if (in_group[sorted_.edges[i].source] != kNoIndex) within.push_back(i);
      }
    }
    std::sort(within.begin(), within.end());
    std::vector<PoseEdge> edges;
    for (const std::size_t i : within) {
      const PoseEdge& edge = sorted_.edges[i];
      const std::size_t target = in_group[edge.target];
      const std::size_t source = in_group[edge.source];
      double variance = 0.0;
      if (!covariances.empty()) {
        for (const std::size_t node : {target, source}) {
          variance += mean_square_disagreement(covariances[node], group.group_from_node[node],
                                               sorted_.extent[group.nodes[node]]);
        }
      }
      if (can_agree(edge, group.group_from_node[target], group.group_from_node[source], variance,
                    sorted_.extent, options_.agreement)) {
        edges.push_back(edge);
      }
    }
    return edges;
  }

  // Improves the poses of a group that grows.
  void refine(PoseGroup& group) const {
    constexpr int kIterations = 10;
    constexpr double kTolerance = 1e-4;
    const std::vector<std::size_t> in_group = indices_in(group, sorted_.node.size());
    PoseLeastSquares problem = least_squares(possible(group, in_group, {}), group, in_group);
    problem.solve(kIterations, kTolerance);
    group.group_from_node = problem.poses();
  }

  bool agrees(const PoseEdge& edge) const {
    const std::size_t target = in_group_[edge.target];
    const std::size_t source = in_group_[edge.source];
    if (target == kNoIndex || source == kNoIndex) return false;
    return disagreement(group_.group_from_node[target] * edge.target_from_source,
                        group_.group_from_node[source],
                        sorted_.extent[edge.source]) <= options_.agreement;
  }

  void begin_at_first() {
    const Similarity3 first_from_group = group_.group_from_node.front().inverse();
    for (Similarity3& pose : group_.group_from_node) pose = first_from_group * pose;
    group_.group_from_node.front() = Similarity3();
  }

  bool is_kept() const {
    return kept_ && kept_->problem.poses().size() == group_.nodes.size() &&
           std::equal(edges_.begin(), edges_.end(), kept_->links.begin(), kept_->links.end(),
                      [](const PoseEdge& edge, std::size_t link) { return edge.link == link; });
  }

  void solve(double tolerance) {
    std::optional<PoseLeastSquares> other;
    if (!is_kept()) other = least_squares(edges_, group_, in_group_);
    PoseLeastSquares& problem = other ? *other : kept_->problem;
    problem.solve(options_.max_iterations, tolerance);
    group_.group_from_node = problem.poses();
    if (!other) kept_->covariances.clear();
  }

  const std::vector<Matrix7d>& covariances() {
    if (!is_kept()) {
      kept_.emplace(Kept{{}, least_squares(edges_, group_, in_group_), {}});
      for (const PoseEdge& edge : edges_) kept_->links.push_back(edge.link);
    }
    if (kept_->covariances.empty()) kept_->covariances = kept_->problem.covariances();
    return kept_->covariances;
  }

  void keep_connected() {
    const auto disagrees = [this](const PoseEdge& edge) { return !agrees(edge); };
    std::erase_if(edges_, disagrees);
    const std::size_t first = group_.nodes.front();
    set_group(sorted_.largest(connected_parts(group_, edges_, in_group_)));
    if (group_.nodes.front() != first) begin_at_first();
    std::erase_if(edges_, disagrees);
  }

  // Moves the poses into the node's frame, so that its own pose is exact.
  std::vector<Matrix7d> covariances_relative_to(std::size_t frame) {
    if (group_.nodes.front() == frame) return covariances();
    std::swap(group_.nodes.front(), group_.nodes[in_group_[frame]]);
    std::swap(group_.group_from_node.front(), group_.group_from_node[in_group_[frame]]);
    in_group_ = indices_in(group_, sorted_.node.size());
    begin_at_first();
    return least_squares(edges_, group_, in_group_).covariances();
  }

  SortedNodes sorted_;
  PoseOptimisationOptions options_;
  std::vector<std::vector<std::size_t>> edges_to_;  // by target
  PoseGroup group_;
  std::vector<std::size_t> in_group_;  // by node
  std::vector<PoseEdge> edges_;        // that are used
  std::optional<Kept> kept_;
};

using LinkEnds = std::vector<std::pair<std::size_t, std::size_t>>;

// A graph of some of the nodes, and what is known of them.
struct Subgraph {
  Subgraph(const PoseGraph& whole, std::span<const NodeExtent> all, const LinkEnds& ends,
           const std::vector<bool>& chosen, const OptimisedPoses* known) {
    for (std::size_t i = 0; i < whole.nodes.size(); ++i) {
      if (!chosen[i]) continue;
      graph.nodes.push_back(whole.nodes[i]);
      extents.push_back(all[i]);
      node_of.push_back(i);
      if (known == nullptr) continue;
      before.world_from_node.push_back(known->world_from_node[i]);
      before.covariances.push_back(known->covariances[i]);
    }
    for (std::size_t i = 0; i < whole.links.size(); ++i) {
      if (!chosen[ends[i].first] || !chosen[ends[i].second]) continue;
      graph.links.push_back(whole.links[i]);
      link_of.push_back(i);
      if (known != nullptr) before.agrees.push_back(known->agrees[i]);
    }
  }

  PoseGraph graph;
  std::vector<NodeExtent> extents;
  OptimisedPoses before;             // empty unless it is known
  std::vector<std::size_t> node_of;  // index in the whole
  std::vector<std::size_t> link_of;
};

}  // namespace

NodeExtent node_extent(std::span<const Eigen::Vector3d> landmarks) {
  NodeExtent extent;
  if (landmarks.empty()) return extent;
  std::vector<double> values(landmarks.size());
  for (int axis = 0; axis < 3; ++axis) {
    for (std::size_t i = 0; i < landmarks.size(); ++i) values[i] = landmarks[i][axis];
    extent.centre[axis] = upper_median(values);
  }
  for (std::size_t i = 0; i < landmarks.size(); ++i) {
    values[i] = (landmarks[i] - extent.centre).norm();
  }
  const double radius = upper_median(values);
  if (radius > 0.0 && std::isfinite(radius)) extent.radius = radius;
  return extent;
}

constexpr OptionField kPoseOptimisationFields[] = {
    {"agreement",
     option_at<&PoseOptimisationOptions::agreement>,
     {.least = 0.0,
      .most = 1.0,
      .expected = "above 0, at most 1",
      .least_is = OptionRange::End::kExcluded}},
    {"max_iterations", option_at<&PoseOptimisationOptions::max_iterations>, kAtLeastOne},
};
constinit const OptionTable PoseOptimisationOptions::table = {"PoseOptimisationOptions",
                                                              kPoseOptimisationFields};

void PoseOptimisationOptions::validate() const {
  check_options(*this);
}

OptimisedPoses optimise_poses(const PoseGraph& graph, std::span<const NodeExtent> extents,
                              const PoseOptimisationOptions& options) {
  options.validate();
  if (graph.nodes.empty()) {
    check_graph(graph, extents);
    return {};
  }
  GroupOptimisation group(graph, extents, options);
  group.run();
  return group.result(graph.links.size());
}

OptimisedComponents optimise_components(const PoseGraph& graph, std::span<const NodeExtent> extents,
                                        const OptimisedPoses* before,
                                        const PoseOptimisationOptions& options) {
  OptimisedComponents result;
  const std::size_t count = graph.nodes.size();
  result.frames.assign(count, std::nullopt);
  result.frame_from_node.resize(count);
  result.covariances.assign(count, Matrix7d::Zero());
  result.agrees.assign(graph.links.size(), std::nullopt);
  check_graph(graph, extents);
  const LinkEnds ends = link_ends(graph);
  std::vector<bool> left(count, true);
  const auto are_left = [&] { return std::count(left.begin(), left.end(), true) >= 2; };
  for (bool first = true; are_left(); first = false) {
    const Subgraph part(graph, extents, ends, left, first ? before : nullptr);
    const OptimisedPoses found = first && before != nullptr
                                     ? update_poses(part.graph, part.extents, part.before, options)
                                     : optimise_poses(part.graph, part.extents, options);
    if (found.tree.empty()) break;
    std::optional<std::size_t> frame;
    for (std::size_t i = 0; i < part.node_of.size(); ++i) {
      if (!found.world_from_node[i]) continue;
      const std::size_t node = part.node_of[i];
      if (!frame) frame = node;
      result.frames[node] = frame;
      result.frame_from_node[node] = *found.world_from_node[i];
      result.covariances[node] = found.covariances[i];
      left[node] = false;
    }
    for (std::size_t i = 0; i < part.link_of.size(); ++i) {
      const auto [target, source] = ends[part.link_of[i]];
      if (!left[target] && !left[source]) result.agrees[part.link_of[i]] = found.agrees[i];
    }
  }
  // A link between two components disagrees with what keeps its nodes apart.
  for (std::size_t i = 0; i < graph.links.size(); ++i) {
    if (!result.agrees[i] && !left[ends[i].first] && !left[ends[i].second]) {
      result.agrees[i] = false;
    }
  }
  return result;
}

std::vector<Matrix7d> covariances_of_poses(const PoseGraph& graph,
                                           std::span<const NodeExtent> extents) {
  std::vector<Similarity3> poses;
  for (const PoseNode& node : graph.nodes) poses.push_back(node.world_from_node);
  return PoseLeastSquares(pose_edges(graph, extents), std::move(poses)).covariances();
}

}  // namespace cairn
