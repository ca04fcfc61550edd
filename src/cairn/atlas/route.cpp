// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <map>
#include <queue>
#include <utility>

#include "cairn/atlas/queries.hpp"
#include "cairn/geometry/covariance.hpp"
#include "cairn/geometry/rigid3.hpp"

namespace cairn {
namespace {

// Variance of a link without covariance: larger than any stated one.
constexpr double kUnknown = 100.0;

// Squared, as a share of the source's radius; not negative, which a covariance may be by rounding.
double variance_of(const Link& link, const AtlasState& state) {
  const auto covariance = link.full_covariance();
  if (!covariance) return kUnknown;
  const double radius =
      state.nodes.at(link.source).extent.radius * link.target_from_source->scale();
  const Matrix7d& c = *covariance;
  const double variance =
      (c(0, 0) + c(1, 1) + c(2, 2)) / (radius * radius) + c(3, 3) + c(4, 4) + c(5, 5) + c(6, 6);
  return std::isfinite(variance) ? std::max(variance, 0.0) : kUnknown;
}

struct Step {
  NodeId to;
  LinkId link;
  double variance = 0.0;
};

// By map: the links that agree with the poses, in both directions.
std::map<NodeId, std::vector<Step>> steps_of(const AtlasState& state) {
  std::map<NodeId, std::vector<Step>> steps;
  for (const auto& [id, link] : state.links) {
    if (!link.connects()) continue;
    const auto agrees = state.agrees.find(id);
    if (agrees != state.agrees.end() && !agrees->second) continue;
    const double variance = variance_of(link, state);
    steps[link.target].push_back({link.source, id, variance});
    steps[link.source].push_back({link.target, id, variance});
  }
  return steps;
}

// Moves the route's end along its next link.
void extend(AtlasRoute& route, const Link& link, bool forward) {
  const Similarity3 step = forward ? *link.target_from_source : link.target_from_source->inverse();
  std::optional<Matrix7d> covariance = link.full_covariance();
  if (covariance && !forward) {
    covariance = inverse_covariance(*link.target_from_source, *covariance);
  }
  if (!covariance) route.covariance.reset();
  if (route.covariance) {
    // With A the way so far and B the step, A·B has t = s_A·R_A·t_B + t_A: δ_AB = J_A·δ_A + J_B·δ_B.
    const Similarity3& a = route.target_from_source;
    const Eigen::Vector3d arm = a.linear() * step.translation();
    using Matrix = Eigen::Matrix<double, 7, 7>;  // aligned
    Matrix of_a = Matrix::Identity();
    of_a.block<3, 3>(0, 3) = -skew(arm);
    of_a.block<3, 1>(0, 6) = arm;
    Matrix of_b = Matrix::Identity();
    of_b.block<3, 3>(0, 0) = a.linear();
    of_b.block<3, 3>(3, 3) = a.rigid().rotation();
    const Matrix so_far = *route.covariance;
    const Matrix added = *covariance;
    const Matrix sum = of_a * so_far * of_a.transpose() + of_b * added * of_b.transpose();
    route.covariance = 0.5 * (sum + sum.transpose());
  }
  route.target_from_source = route.target_from_source * step;
}

}  // namespace

std::optional<AtlasRoute> find_route(const AtlasState& state, NodeId target, NodeId source) {
  std::map<NodeId, std::vector<Step>> steps = steps_of(state);
  // Dijkstra; ties by lower id, so that the result is unique.
  std::map<NodeId, double> sums = {{target, 0.0}};
  std::map<NodeId, std::pair<NodeId, LinkId>> before;
  using Entry = std::pair<double, NodeId>;
  std::priority_queue<Entry, std::vector<Entry>, std::greater<>> open;
  open.emplace(0.0, target);
  while (!open.empty()) {
    const auto [sum, node] = open.top();
    open.pop();
    if (sum > sums[node]) continue;
    if (node == source) break;
    for (const Step& step : steps[node]) {
      // Adds a small cost per link, so that the fewest of several exact links are used.
      const double longer = sum + step.variance + 1e-12;
      const auto known = sums.find(step.to);
      if (known != sums.end() && known->second <= longer) continue;
      sums[step.to] = longer;
      before[step.to] = {node, step.link};
      open.emplace(longer, step.to);
    }
  }
  if (!sums.contains(source)) return std::nullopt;

  AtlasRoute route;
  for (NodeId node = source; node != target; node = before.at(node).first) {
    route.nodes.push_back(node);
    route.links.push_back(before.at(node).second);
  }
  route.nodes.push_back(target);
  std::reverse(route.nodes.begin(), route.nodes.end());
  std::reverse(route.links.begin(), route.links.end());
  route.covariance = Matrix7d::Zero();
  for (std::size_t i = 0; i < route.links.size(); ++i) {
    const Link& link = state.links.at(route.links[i]);
    extend(route, link, link.target == route.nodes[i]);
  }
  const auto pose_of_target = state.poses.find(target);
  const auto pose_of_source = state.poses.find(source);
  if (pose_of_target != state.poses.end() && pose_of_source != state.poses.end() &&
      pose_of_target->second.frame == pose_of_source->second.frame) {
    route.optimised =
        pose_of_target->second.frame_from_node.inverse() * pose_of_source->second.frame_from_node;
  }
  return route;
}

}  // namespace cairn
