// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <optional>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/pose_graph/detail/grown_poses.hpp"
#include "cairn/pose_graph/detail/pose_edges.hpp"
#include "cairn/pose_graph/detail/pose_least_squares.hpp"
#include "cairn/pose_graph/optimise_poses.hpp"

namespace cairn {

using namespace detail;  // what the solver is made of

namespace {

constexpr double kTolerance = 1e-12;

// The group of placed nodes and of those that join it, while its poses are updated.
class Update {
 public:
  Update(std::span<const PoseEdge> edges, std::span<const NodeExtent> extents,
         const OptimisedPoses& before, const PoseGroup& group,
         const PoseOptimisationOptions& options)
      : edges_(edges),
        extents_(extents),
        options_(options),
        frame_(group.nodes.front()),
        pose_(extents.size()),
        covariance_(before.covariances),
        use_(edges.size(), Use::kOutside),
        edges_at_(extents.size()) {
    for (std::size_t i = 0; i < group.nodes.size(); ++i)
      pose_[group.nodes[i]] = group.group_from_node[i];
    has_new_nodes_ = std::any_of(group.nodes.begin(), group.nodes.end(),
                                 [&](std::size_t node) { return !before.world_from_node[node]; });
    for (std::size_t i = 0; i < edges_.size(); ++i) {
      const PoseEdge& edge = edges_[i];
      if (!pose_[edge.target] || !pose_[edge.source]) continue;
      use_[i] = before.agrees[edge.link] ? Use::kUsed : Use::kUnused;
      edges_at_[edge.target].push_back(i);
      edges_at_[edge.source].push_back(i);
    }
  }

  // Until no further edge is used, and none that is used disagrees.
  // @return whether the used edges still connect the group
  bool run() {
    bool changed = has_new_nodes_;
    for (;;) {
      changed = admit() || changed;
      if (!is_connected()) return false;
      if (!changed) return true;
      solve();
      changed = expel();
    }
  }

  OptimisedPoses result(std::size_t links) const {
    OptimisedPoses poses;
    poses.world_from_node = pose_;
    poses.covariances.assign(pose_.size(), Matrix7d::Zero());
    poses.agrees.assign(links, false);
    for (std::size_t i = 0; i < pose_.size(); ++i) {
      if (pose_[i]) poses.covariances[i] = covariance_[i];
    }
    const std::vector<PoseEdge> used = used_edges();
    for (const PoseEdge& edge : used) poses.agrees[edge.link] = true;
    poses.tree = most_certain_tree(frame_, used, extents_);
    return poses;
  }

 private:
  enum class Use { kOutside, kUnused, kUsed, kExpelled };

  std::vector<PoseEdge> used_edges() const {
    std::vector<PoseEdge> used;
    for (std::size_t i = 0; i < edges_.size(); ++i) {
      if (use_[i] == Use::kUsed) used.push_back(edges_[i]);
    }
    return used;
  }

  double variance_of(std::size_t node) const {
    return mean_square_disagreement(covariance_[node], *pose_[node], extents_[node]);
  }

  // Uses the unused edges that can agree.
  // @return whether there are any
  bool admit() {
    bool any = false;
    for (std::size_t i = 0; i < edges_.size(); ++i) {
      const PoseEdge& edge = edges_[i];
      if (use_[i] != Use::kUnused || !can_agree(edge, *pose_[edge.target], *pose_[edge.source],
                                                variance_of(edge.target) + variance_of(edge.source),
                                                extents_, options_.agreement)) {
        continue;
      }
      use_[i] = Use::kUsed;
      any = true;
    }
    return any;
  }

  // No longer uses edges that disagree.
  // @return whether there are any
  bool expel() {
    bool any = false;
    for (std::size_t i = 0; i < edges_.size(); ++i) {
      const PoseEdge& edge = edges_[i];
      if (use_[i] != Use::kUsed ||
          disagreement(*pose_[edge.target] * edge.target_from_source, *pose_[edge.source],
                       extents_[edge.source]) <= options_.agreement) {
        continue;
      }
      use_[i] = Use::kExpelled;
      any = true;
    }
    return any;
  }

  bool is_connected() const {
    std::vector<bool> reached(pose_.size(), false);
    std::vector<std::size_t> nodes = {frame_};
    reached[frame_] = true;
    for (std::size_t next = 0; next < nodes.size(); ++next) {  // NOLINT(*-loop-convert): it grows
      const std::size_t node = nodes[next];
      for (const std::size_t i : edges_at_[node]) {
        const std::size_t other = edges_[i].target + edges_[i].source - node;
        if (use_[i] != Use::kUsed || reached[other]) continue;
        reached[other] = true;
        nodes.push_back(other);
      }
    }
    return nodes.size() == placed_nodes().size();
  }

  std::vector<std::size_t> placed_nodes() const {
    std::vector<std::size_t> nodes = {frame_};
    for (std::size_t i = 0; i < pose_.size(); ++i) {
      if (pose_[i] && i != frame_) nodes.push_back(i);
    }
    return nodes;
  }

  // Least squares of all used edges from the present poses, with the covariances that these edges give.
  void solve() {
    const std::vector<std::size_t> nodes = placed_nodes();
    std::vector<std::size_t> index(pose_.size(), kNoIndex);
    std::vector<Similarity3> poses;
    for (std::size_t i = 0; i < nodes.size(); ++i) {
      index[nodes[i]] = i;
      poses.push_back(*pose_[nodes[i]]);
    }
    std::vector<PoseEdge> edges = used_edges();
    for (PoseEdge& edge : edges) {
      edge.target = index[edge.target];
      edge.source = index[edge.source];
    }
    PoseLeastSquares problem(std::move(edges), std::move(poses));
    problem.solve(options_.max_iterations, kTolerance);
    const std::vector<Matrix7d> covariances = problem.covariances();
    for (std::size_t i = 1; i < nodes.size(); ++i) {
      pose_[nodes[i]] = problem.poses()[i];
      covariance_[nodes[i]] = covariances[i];
    }
  }

  std::span<const PoseEdge> edges_;
  std::span<const NodeExtent> extents_;
  PoseOptimisationOptions options_;
  std::size_t frame_;
  std::vector<std::optional<Similarity3>> pose_;  // by node; std::nullopt outside the group
  std::vector<Matrix7d> covariance_;              // by node
  bool has_new_nodes_ = false;
  std::vector<Use> use_;                            // by edge
  std::vector<std::vector<std::size_t>> edges_at_;  // by node
};

// The poses in the frame of the first node that was placed before.
PoseGroup in_frame_of(const OptimisedPoses& before, PoseGroup group) {
  for (std::size_t i = 0; i < group.nodes.size(); ++i) {
    const auto& pose = before.world_from_node[group.nodes[i]];
    if (!pose) continue;
    if (group.group_from_node[i].matrix() == pose->matrix()) break;
    const Similarity3 world_from_group = *pose * group.group_from_node[i].inverse();
    for (Similarity3& other : group.group_from_node) other = world_from_group * other;
    break;
  }
  return group;
}

}  // namespace

OptimisedPoses update_poses(const PoseGraph& graph, std::span<const NodeExtent> extents,
                            const OptimisedPoses& before, const PoseOptimisationOptions& options) {
  options.validate();
  const std::vector<PoseEdge> edges = pose_edges(graph, extents);
  const std::size_t count = graph.nodes.size();
  refuse_if(before.world_from_node.size() != count || before.covariances.size() != count ||
                before.agrees.size() != graph.links.size(),
            "before",
            fmt::format("{} poses, {} covariances and {} links", before.world_from_node.size(),
                        before.covariances.size(), before.agrees.size()),
            fmt::format("one entry a node ({}) and a link ({})", count, graph.links.size()));
  const auto is_placed = [&](std::size_t node) { return before.world_from_node[node].has_value(); };
  // The groups that join the placed nodes are small: their links, unlike those of the whole, need no robust
  // solution on the way.
  const auto keep = [](PoseGroup&) {};
  for (PoseGroup& group : grow_groups(edges, extents, session_numbers(graph), options.agreement,
                                      keep, before.world_from_node)) {
    if (std::none_of(group.nodes.begin(), group.nodes.end(), is_placed)) continue;
    const auto placed =
        static_cast<std::size_t>(std::count_if(group.nodes.begin(), group.nodes.end(), is_placed));
    if (!is_placed(group.nodes.front()) || 2 * placed < group.nodes.size()) break;
    Update update(edges, extents, before, in_frame_of(before, std::move(group)), options);
    if (!update.run()) break;
    return update.result(graph.links.size());
  }
  return optimise_poses(graph, extents, options);
}

}  // namespace cairn
