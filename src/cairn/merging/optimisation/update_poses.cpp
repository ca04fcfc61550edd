// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/merging/optimisation/update_poses.hpp"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/merging/detail/derivative_by_map.hpp"
#include "cairn/merging/detail/grown_poses.hpp"
#include "cairn/merging/detail/pose_edges.hpp"
#include "cairn/merging/detail/pose_least_squares.hpp"

namespace cairn {
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
        is_new_(extents.size(), false),
        use_(edges.size(), Use::kOutside),
        edges_at_(extents.size()) {
    for (std::size_t i = 0; i < group.nodes.size(); ++i)
      pose_[group.nodes[i]] = group.group_from_node[i];
    for (const std::size_t node : group.nodes) is_new_[node] = !before.world_from_node[node];
    for (std::size_t i = 0; i < edges_.size(); ++i) {
      const PoseEdge& edge = edges_[i];
      deviation_.push_back(std::sqrt(mean_square_disagreement(edge, extents_)));
      if (!pose_[edge.target] || !pose_[edge.source]) continue;
      use_[i] = before.agrees[edge.link] ? Use::kUsed : Use::kUnused;
      edges_at_[edge.target].push_back(i);
      edges_at_[edge.source].push_back(i);
    }
  }

  // Until no further edge is used, and none that is used disagrees.
  // @return whether the used edges still connect the group
  bool run() {
    std::vector<std::size_t> seeds = new_nodes();
    for (;;) {
      for (const std::size_t node : admit()) seeds.push_back(node);
      if (!is_connected()) return false;
      if (seeds.empty()) return true;
      solve(seeds);
      seeds = expel();
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

  std::vector<std::size_t> new_nodes() const {
    std::vector<std::size_t> nodes;
    for (std::size_t i = 0; i < is_new_.size(); ++i) {
      if (is_new_[i]) nodes.push_back(i);
    }
    return nodes;
  }

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
  // @return their nodes
  std::vector<std::size_t> admit() {
    std::vector<std::size_t> nodes;
    for (std::size_t i = 0; i < edges_.size(); ++i) {
      const PoseEdge& edge = edges_[i];
      if (use_[i] != Use::kUnused || !can_agree(edge, *pose_[edge.target], *pose_[edge.source],
                                                variance_of(edge.target) + variance_of(edge.source),
                                                extents_, options_.agreement)) {
        continue;
      }
      use_[i] = Use::kUsed;
      nodes.push_back(edge.target);
      nodes.push_back(edge.source);
    }
    return nodes;
  }

  // No longer uses edges that disagree.
  // @return their nodes
  std::vector<std::size_t> expel() {
    std::vector<std::size_t> nodes;
    for (std::size_t i = 0; i < edges_.size(); ++i) {
      const PoseEdge& edge = edges_[i];
      if (use_[i] != Use::kUsed ||
          disagreement(*pose_[edge.target] * edge.target_from_source, *pose_[edge.source],
                       extents_[edge.source]) <= options_.agreement) {
        continue;
      }
      use_[i] = Use::kExpelled;
      nodes.push_back(edge.target);
      nodes.push_back(edge.source);
    }
    return nodes;
  }

  bool is_connected() const {
    const auto placed = static_cast<std::size_t>(std::count_if(
        pose_.begin(), pose_.end(), [](const auto& pose) { return pose.has_value(); }));
    return reached_from({frame_}, placed).size() == placed;
  }

  // Nodes within some number of used edges, nearest first.
  std::vector<std::size_t> reached_from(const std::vector<std::size_t>& seeds,
                                        std::size_t steps) const {
    std::vector<std::size_t> distance(pose_.size(), kNoIndex);
    std::vector<std::size_t> nodes;
    const auto reach = [&](std::size_t node, std::size_t far) {
      if (distance[node] != kNoIndex) return;
      distance[node] = far;
      nodes.push_back(node);
    };
    for (const std::size_t seed : seeds) reach(seed, 0);
    for (std::size_t next = 0; next < nodes.size(); ++next) {  // NOLINT(*-loop-convert): it grows
      const std::size_t node = nodes[next];
      if (distance[node] == steps) break;
      for (const std::size_t i : edges_at_[node]) {
        if (use_[i] == Use::kUsed)
          reach(edges_[i].target + edges_[i].source - node, distance[node] + 1);
      }
    }
    return nodes;
  }

  // Optimises the poses about the seeds, as far out as they move.
  void solve(const std::vector<std::size_t>& seeds) {
    constexpr std::size_t kFirst = 3;  // steps
    for (std::size_t steps = kFirst; !solve_within(reached_from(seeds, steps)); steps *= 2) {
    }
  }

  // @return false, without a change, if that is not settled without more nodes
  bool solve_within(std::vector<std::size_t> moving) {
    std::erase(moving, frame_);
    std::vector<std::size_t> index(pose_.size(), kNoIndex);
    for (const std::size_t node : moving) index[node] = 0;
    // Fixed poses come first, and among these the frame's: it can be alone.
    std::vector<std::size_t> nodes = {frame_};
    std::vector<std::pair<std::size_t, double>>
        rim;  // nodes, with the deviation of a link that ends there
    std::vector<PoseEdge> edges;
    std::vector<bool> is_fixed(pose_.size(), false);
    is_fixed[frame_] = true;
    for (const std::size_t node : moving) {
      for (const std::size_t i : edges_at_[node]) {
        if (use_[i] != Use::kUsed) continue;
        const std::size_t other = edges_[i].target + edges_[i].source - node;
        if (index[other] == kNoIndex && other != frame_) rim.emplace_back(node, deviation_[i]);
        if (index[other] == kNoIndex && !is_fixed[other]) nodes.push_back(other);
        if (index[other] == kNoIndex) is_fixed[other] = true;
        if (index[other] == kNoIndex || node == edges_[i].target) edges.push_back(edges_[i]);
      }
    }
    const std::size_t fixed = nodes.size();
    nodes.insert(nodes.end(), moving.begin(), moving.end());
    std::vector<Similarity3> poses;
    for (std::size_t i = 0; i < nodes.size(); ++i) {
      index[nodes[i]] = i;
      poses.push_back(*pose_[nodes[i]]);
    }
    for (PoseEdge& edge : edges) {
      edge.target = index[edge.target];
      edge.source = index[edge.source];
    }
    PoseLeastSquares problem(edges, std::move(poses), fixed);
    problem.solve(options_.max_iterations, kTolerance);
    if (!rim.empty() && !is_settled(problem.poses(), nodes, rim, index, edges)) return false;
    for (std::size_t i = fixed; i < nodes.size(); ++i) pose_[nodes[i]] = problem.poses()[i];
    update_covariances(problem.covariances(), nodes, fixed, edges);
    return true;
  }

  // Whether poses at the rim hardly move, compared with their edges' deviations, and all edges agree. An edge that closes a long loop disagrees with the
  // poses until the whole loop takes part.
  bool is_settled(const std::vector<Similarity3>& poses, const std::vector<std::size_t>& nodes,
                  const std::vector<std::pair<std::size_t, double>>& rim,
                  const std::vector<std::size_t>& index, std::span<const PoseEdge> edges) const {
    constexpr double kStill = 0.05;
    return std::none_of(rim.begin(), rim.end(),
                        [&](const std::pair<std::size_t, double>& end) {
                          const auto [node, deviation] = end;
                          return disagreement(*pose_[node], poses[index[node]], extents_[node]) >
                                 kStill * deviation;
                        }) &&
           std::all_of(edges.begin(), edges.end(), [&](const PoseEdge& edge) {
             return disagreement(poses[edge.target] * edge.target_from_source, poses[edge.source],
                                 extents_[nodes[edge.source]]) <= options_.agreement;
           });
  }

  // From those relative to the fixed nodes, which are uncertain themselves.
  void update_covariances(const std::vector<Matrix7d>& relative,
                          const std::vector<std::size_t>& nodes, std::size_t fixed,
                          std::span<const PoseEdge> edges) {
    if (fixed == 1) {
      for (std::size_t i = fixed; i < nodes.size(); ++i) covariance_[nodes[i]] = relative[i];
      return;
    }
    // By node: the nearest fixed one.
    std::vector<std::vector<std::size_t>> beside(nodes.size());
    for (const PoseEdge& edge : edges) {
      beside[edge.target].push_back(edge.source);
      beside[edge.source].push_back(edge.target);
    }
    std::vector<std::size_t> nearest(nodes.size(), kNoIndex);
    std::vector<std::size_t> queue;
    for (std::size_t i = 0; i < fixed; ++i) {
      nearest[i] = i;
      queue.push_back(i);
    }
    for (std::size_t next = 0; next < queue.size(); ++next) {
      for (const std::size_t other : beside[queue[next]]) {
        if (nearest[other] != kNoIndex) continue;
        nearest[other] = nearest[queue[next]];
        queue.push_back(other);
      }
    }
    for (std::size_t i = fixed; i < nodes.size(); ++i) {
      if (!is_new_[nodes[i]]) continue;
      const std::size_t anchor = nodes[nearest[i]];
      covariance_[nodes[i]] =
          relative[i] + carried_covariance(covariance_[anchor], pose_[anchor]->translation(),
                                           pose_[nodes[i]]->translation());
    }
  }

  std::span<const PoseEdge> edges_;
  std::span<const NodeExtent> extents_;
  PoseOptimisationOptions options_;
  std::size_t frame_;
  std::vector<std::optional<Similarity3>> pose_;    // by node; std::nullopt outside the group
  std::vector<Matrix7d> covariance_;                // by node
  std::vector<bool> is_new_;                        // by node
  std::vector<double> deviation_;                   // by edge: of the disagreement
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
  if (before.world_from_node.size() != count || before.covariances.size() != count ||
      before.agrees.size() != graph.links.size()) {
    throw Error(ErrorKind::kMisuse, "before",
                fmt::format("{} poses, {} covariances and {} links", before.world_from_node.size(),
                            before.covariances.size(), before.agrees.size()),
                fmt::format("one entry a node ({}) and a link ({})", count, graph.links.size()));
  }
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
