// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/merging/optimisation/optimise_poses.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <utility>

#include <Eigen/Cholesky>
#include <ceres/ceres.h>
#include <ceres/rotation.h>
#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/geometry/covariance.hpp"

namespace cairn {
namespace {

using Matrix7 = Eigen::Matrix<double, 7, 7>;

constexpr std::size_t kNone = static_cast<std::size_t>(-1);
// Deviation of the scale's logarithm in a link that does not measure it: maps of one unit.
constexpr double kSameScale = 1e-6;
// Below which 99.9 % of chi-squared numbers of 7 degrees of freedom lie: where the loss turns robust.
constexpr double kUsual = 24.3;

struct Edge {
  std::size_t link = 0;
  std::size_t target = 0;
  std::size_t source = 0;
  Similarity3 target_from_source;
  Matrix7d covariance;
};

// Root mean square of how far two poses move the node's landmarks apart, in radii.
double disagreement(const Similarity3& a, const Similarity3& b, const NodeExtent& extent) {
  const double radius = a.scale() * extent.radius;
  const double shift = (a * extent.centre - b * extent.centre).norm() / radius;
  const double turn = (a.rigid().inverse() * b.rigid()).angle();
  const double growth = std::log(b.scale() / a.scale());
  return std::sqrt(shift * shift + turn * turn + growth * growth);
}

// No link is more exact than a millionth of what it moves, or the problem's numbers would be lost.
constexpr double kExact = 1e-6;

std::vector<Edge> edges_of(const PoseGraph& graph, std::span<const NodeExtent> extents) {
  std::vector<std::pair<NodeId, std::size_t>> by_id;
  for (std::size_t i = 0; i < graph.nodes.size(); ++i) by_id.emplace_back(graph.nodes[i].id, i);
  std::sort(by_id.begin(), by_id.end());
  const auto index_of = [&](NodeId id) {
    return std::lower_bound(by_id.begin(), by_id.end(), std::pair(id, std::size_t{0}))->second;
  };
  std::vector<Edge> edges;
  for (std::size_t i = 0; i < graph.links.size(); ++i) {
    const PoseLink& link = graph.links[i];
    Edge edge{i, index_of(link.target), index_of(link.source), link.target_from_source, {}};
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

// Nodes of the largest component, ascending; of those as large the one with the first node.
std::vector<std::size_t> largest_component(std::size_t nodes, const std::vector<Edge>& edges) {
  std::vector<std::size_t> root(nodes);
  std::iota(root.begin(), root.end(), std::size_t{0});
  const auto find = [&](std::size_t node) {
    while (root[node] != node) node = root[node] = root[root[node]];
    return node;
  };
  for (const Edge& edge : edges) {
    const std::size_t a = find(edge.target);
    const std::size_t b = find(edge.source);
    root[std::max(a, b)] = std::min(a, b);
  }
  std::vector<std::size_t> sizes(nodes, 0);
  for (std::size_t i = 0; i < nodes; ++i) ++sizes[find(i)];
  const auto largest =
      static_cast<std::size_t>(std::max_element(sizes.begin(), sizes.end()) - sizes.begin());
  std::vector<std::size_t> members;
  for (std::size_t i = 0; i < nodes; ++i) {
    if (find(i) == largest) members.push_back(i);
  }
  return members;
}

// A pose that a link to a placed node gives a node.
struct Proposal {
  std::size_t edge = 0;
  Similarity3 world_from_node;
  double uncertainty = 0.0;  // of the link, in radii
};

// How well a link determines the source's place, root mean square in its radii.
double uncertainty_of(const Edge& edge, const NodeExtent& extent) {
  const double radius = edge.target_from_source.scale() * extent.radius;
  const Matrix7d& c = edge.covariance;
  const double shift = (c(0, 0) + c(1, 1) + c(2, 2)) / (radius * radius);
  return std::sqrt(shift + c(3, 3) + c(4, 4) + c(5, 5) + c(6, 6));
}

// Of each edge: how many other nodes there are, by way of which two edges give the pose that it gives.
std::vector<std::size_t> supports(const std::vector<Edge>& edges,
                                  std::span<const NodeExtent> extents, double agreement) {
  struct Step {
    std::size_t to = 0;
    Similarity3 from_to;
  };
  std::vector<std::vector<Step>> steps(extents.size());
  for (const Edge& edge : edges) {
    steps[edge.target].push_back({edge.source, edge.target_from_source});
    steps[edge.source].push_back({edge.target, edge.target_from_source.inverse()});
  }
  const auto before = [](const Step& a, const Step& b) { return a.to < b.to; };
  for (std::vector<Step>& from : steps) std::stable_sort(from.begin(), from.end(), before);
  std::vector<std::size_t> result;
  result.reserve(edges.size());
  for (const Edge& edge : edges) {
    std::size_t support = 0;
    for (const Step& first : steps[edge.target]) {
      const std::vector<Step>& onward = steps[first.to];
      const auto [begin, end] =
          std::equal_range(onward.begin(), onward.end(), Step{edge.source, {}}, before);
      support += std::any_of(begin, end, [&](const Step& second) {
        return disagreement(first.from_to * second.from_to, edge.target_from_source,
                            extents[edge.source]) <= agreement;
      });
    }
    result.push_back(support);
  }
  return result;
}

// Places the component's nodes from its first one by vote.
void place_by_vote(const std::vector<Edge>& edges, std::span<const NodeExtent> extents,
                   std::span<const std::size_t> component, double agreement,
                   OptimisedPoses& poses) {
  std::vector<std::vector<Proposal>> proposals(extents.size());
  const std::vector<std::size_t> support = supports(edges, extents, agreement);
  const auto place = [&](std::size_t node, const Similarity3& pose) {
    poses.world_from_node[node] = pose;
    for (std::size_t i = 0; i < edges.size(); ++i) {
      const Edge& edge = edges[i];
      const double uncertainty = uncertainty_of(edge, extents[edge.source]);
      if (edge.target == node && !poses.world_from_node[edge.source]) {
        proposals[edge.source].push_back({i, pose * edge.target_from_source, uncertainty});
      } else if (edge.source == node && !poses.world_from_node[edge.target]) {
        proposals[edge.target].push_back(
            {i, pose * edge.target_from_source.inverse(), uncertainty});
      }
    }
  };
  place(component.front(), Similarity3());
  for (std::size_t placed = 1; placed < component.size(); ++placed) {
    std::size_t best_node = kNone;
    std::size_t most_votes = 0;
    const Proposal* best = nullptr;
    for (const std::size_t node : component) {
      if (poses.world_from_node[node]) continue;
      for (const Proposal& proposal : proposals[node]) {
        const auto agreeing = static_cast<std::size_t>(std::count_if(
            proposals[node].begin(), proposals[node].end(), [&](const Proposal& other) {
              return disagreement(proposal.world_from_node, other.world_from_node, extents[node]) <=
                     agreement;
            }));
        const std::size_t votes = agreeing + support[proposal.edge];
        const bool better = best == nullptr || votes > most_votes ||
                            (votes == most_votes && proposal.uncertainty < best->uncertainty);
        if (!better) continue;
        best_node = node;
        most_votes = votes;
        best = &proposal;
      }
    }
    poses.tree.push_back(edges[best->edge].link);
    place(best_node, best->world_from_node);
  }
}

// A pose as Ceres moves it.
struct Block {
  std::array<double, 4> q = {};  // x y z w
  std::array<double, 3> t = {};
  double log_scale = 0.0;
};

Block to_block(const Similarity3& pose) {
  const Eigen::Quaterniond q = pose.rigid().quaternion();
  const Eigen::Vector3d& t = pose.translation();
  return {{q.x(), q.y(), q.z(), q.w()}, {t.x(), t.y(), t.z()}, std::log(pose.scale())};
}

Similarity3 to_pose(const Block& block) {
  return {std::exp(block.log_scale),
          Rigid3(Eigen::Quaterniond(block.q[3], block.q[0], block.q[1], block.q[2]),
                 Eigen::Vector3d(block.t[0], block.t[1], block.t[2]))};
}

// The perturbation that the poses' target_from_source is of the measured one, whitened.
class LinkCost {
 public:
  LinkCost(const Similarity3& measured, const Matrix7& root_information)
      : measured_(measured), root_information_(root_information) {}

  template <class T>
  bool operator()(const T* q_target, const T* t_target, const T* s_target, const T* q_source,
                  const T* t_source, const T* s_source, T* residuals) const {
    using Quaternion = Eigen::Quaternion<T>;
    using Vector = Eigen::Matrix<T, 3, 1>;
    const Quaternion target_from_world = Eigen::Map<const Quaternion>(q_target).conjugate();
    const Quaternion rotation = target_from_world * Eigen::Map<const Quaternion>(q_source);
    const Vector between = Eigen::Map<const Vector>(t_source) - Eigen::Map<const Vector>(t_target);
    const Vector translation = target_from_world * between * ceres::exp(-s_target[0]);
    const Quaternion error =
        rotation * measured_.rigid().quaternion().conjugate().template cast<T>();
    const std::array<T, 4> wxyz = {error.w(), error.x(), error.y(), error.z()};
    Eigen::Matrix<T, 7, 1> perturbation;
    ceres::QuaternionToAngleAxis(wxyz.data(), perturbation.data() + 3);
    perturbation.template head<3>() = translation - measured_.translation().template cast<T>();
    perturbation[6] = s_source[0] - s_target[0] - std::log(measured_.scale());
    Eigen::Map<Eigen::Matrix<T, 7, 1>>{residuals} =
        root_information_.template cast<T>() * perturbation;
    return true;
  }

 private:
  Similarity3 measured_;
  Matrix7 root_information_;
};

// Solves the component's poses, the first of which stays, and their covariances.
void solve(const std::vector<Edge>& edges, std::span<const std::size_t> component,
           const PoseOptimisationOptions& options, OptimisedPoses& poses) {
  std::vector<Block> blocks(poses.world_from_node.size());
  for (const std::size_t node : component) blocks[node] = to_block(*poses.world_from_node[node]);
  ceres::EigenQuaternionManifold unit_quaternions;
  ceres::CauchyLoss loss(std::sqrt(kUsual));
  ceres::Problem::Options keep;
  keep.manifold_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  keep.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  ceres::Problem graph(keep);
  for (const std::size_t node : component) {
    graph.AddParameterBlock(blocks[node].q.data(), 4, &unit_quaternions);
    graph.AddParameterBlock(blocks[node].t.data(), 3);
    graph.AddParameterBlock(&blocks[node].log_scale, 1);
  }
  Block& first = blocks[component.front()];
  graph.SetParameterBlockConstant(first.q.data());
  graph.SetParameterBlockConstant(first.t.data());
  graph.SetParameterBlockConstant(&first.log_scale);
  for (const Edge& edge : edges) {
    if (!poses.world_from_node[edge.target] || !poses.world_from_node[edge.source]) continue;
    // With C = L·Lᵀ the whitened error is L⁻¹·δ.
    const Matrix7 root = Eigen::LLT<Matrix7>(edge.covariance).matrixL();
    const Matrix7 inverse_root =
        root.triangularView<Eigen::Lower>().solve(Matrix7::Identity().eval());
    Block& target = blocks[edge.target];
    Block& source = blocks[edge.source];
    graph.AddResidualBlock(new ceres::AutoDiffCostFunction<LinkCost, 7, 4, 3, 1, 4, 3, 1>(
                               new LinkCost(edge.target_from_source, inverse_root)),
                           &loss, target.q.data(), target.t.data(), &target.log_scale,
                           source.q.data(), source.t.data(), &source.log_scale);
  }
  ceres::Solver::Options how;
  how.linear_solver_type = ceres::SPARSE_NORMAL_CHOLESKY;
  how.max_num_iterations = options.max_iterations;
  how.num_threads = 1;
  how.logging_type = ceres::SILENT;
  how.function_tolerance = 1e-12;
  ceres::Solver::Summary summary;
  ceres::Solve(how, &graph, &summary);
  for (const std::size_t node : component) {
    if (node != component.front()) poses.world_from_node[node] = to_pose(blocks[node]);
  }

  ceres::Covariance::Options covariance_options;
  covariance_options.num_threads = 1;
  ceres::Covariance covariance(covariance_options);
  std::vector<std::pair<const double*, const double*>> wanted;
  const auto parts = [](const Block& block) {
    return std::vector<const double*>{block.t.data(), block.q.data(), &block.log_scale};
  };
  for (const std::size_t node : component) {
    if (node == component.front()) continue;
    const auto own = parts(blocks[node]);
    for (std::size_t i = 0; i < own.size(); ++i) {
      for (std::size_t j = i; j < own.size(); ++j) wanted.emplace_back(own[i], own[j]);
    }
  }
  if (wanted.empty()) return;
  if (!covariance.Compute(wanted, &graph)) {
    throw Error(ErrorKind::kInput, "pose graph", "its links do not determine the poses",
                "links whose covariances can be inverted");
  }
  for (const std::size_t node : component) {
    if (node == component.front()) continue;
    Eigen::Matrix<double, 7, 7, Eigen::RowMajor> tangent;
    covariance.GetCovarianceMatrixInTangentSpace(parts(blocks[node]), tangent.data());
    // Ceres turns a quaternion by twice its tangent vector.
    Eigen::Matrix<double, 7, 1> factor;
    factor << 1.0, 1.0, 1.0, 2.0, 2.0, 2.0, 1.0;
    const Matrix7 result = factor.asDiagonal() * tangent * factor.asDiagonal();
    poses.covariances[node] = 0.5 * (result + result.transpose());
  }
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
  std::vector<Edge> edges = edges_of(graph, extents);
  OptimisedPoses poses;
  if (graph.nodes.empty()) return poses;
  // What disagrees goes, and with it what it alone connects: each round has fewer links.
  while (true) {
    poses.world_from_node.assign(graph.nodes.size(), std::nullopt);
    poses.covariances.assign(graph.nodes.size(), Matrix7d::Zero());
    poses.agrees.assign(graph.links.size(), false);
    poses.tree.clear();
    const std::vector<std::size_t> component = largest_component(graph.nodes.size(), edges);
    place_by_vote(edges, extents, component, options.agreement, poses);
    solve(edges, component, options, poses);
    const std::size_t before = edges.size();
    std::erase_if(edges, [&](const Edge& edge) {
      if (!poses.world_from_node[edge.target] || !poses.world_from_node[edge.source]) return false;
      const Similarity3& world_from_target = *poses.world_from_node[edge.target];
      return disagreement(world_from_target * edge.target_from_source,
                          *poses.world_from_node[edge.source],
                          extents[edge.source]) > options.agreement;
    });
    if (edges.size() < before) continue;
    for (const Edge& edge : edges) {
      poses.agrees[edge.link] = poses.world_from_node[edge.target].has_value() &&
                                poses.world_from_node[edge.source].has_value();
    }
    return poses;
  }
}

}  // namespace cairn
