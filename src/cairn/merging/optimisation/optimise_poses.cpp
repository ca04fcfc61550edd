// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/merging/optimisation/optimise_poses.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <map>
#include <numeric>
#include <queue>
#include <string>
#include <tuple>
#include <utility>

#include <Eigen/Cholesky>
#include <Eigen/SparseCore>
#include <ceres/ceres.h>
#include <ceres/rotation.h>
#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/geometry/covariance.hpp"
#include "cairn/merging/detail/grown_poses.hpp"
#include "cairn/merging/detail/selected_inverse.hpp"

namespace cairn {
namespace {

using Matrix7 = Eigen::Matrix<double, 7, 7>;

constexpr std::size_t kNone = static_cast<std::size_t>(-1);
// Deviation of the scale's logarithm in a link that does not measure it: maps of one unit.
constexpr double kSameScale = 1e-6;
// Below which 99.9 % of chi-squared numbers of 7 degrees of freedom lie: where the loss turns robust.
constexpr double kUsual = 24.3;

// No link is more exact than a millionth of what it moves, or the problem's numbers would be lost.
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

// Mean square of what a covariance lets a pose be off, in radii.
double variance_of(const Matrix7d& c, double radius) {
  return (c(0, 0) + c(1, 1) + c(2, 2)) / (radius * radius) + c(3, 3) + c(4, 4) + c(5, 5) + c(6, 6);
}

// Numbers of the nodes' sessions; a node of none is one by itself.
std::vector<std::size_t> runs_of(const PoseGraph& graph) {
  std::map<std::string, std::size_t> numbers;
  std::vector<std::size_t> runs;
  for (std::size_t i = 0; i < graph.nodes.size(); ++i) {
    const std::string& session = graph.nodes[i].session;
    runs.push_back(session.empty() ? i : numbers.try_emplace(session, i).first->second);
  }
  return runs;
}

// Poses of nodes, of which the first stays, and the edges between them.
class Problem {
 public:
  /// @param in_group beside all nodes of the graph: index into `poses`, or kNone
  Problem(const std::vector<PoseEdge>& edges, const std::vector<Similarity3>& poses,
          const std::vector<std::size_t>& in_group)
      : graph_(ownership()) {
    for (const Similarity3& pose : poses) blocks_.push_back(to_block(pose));
    for (Block& block : blocks_) {
      graph_.AddParameterBlock(block.q.data(), 4, &unit_quaternions_);
      graph_.AddParameterBlock(block.t.data(), 3);
      graph_.AddParameterBlock(&block.log_scale, 1);
    }
    for (const PoseEdge& edge : edges) {
      const std::size_t to = in_group[edge.target];
      const std::size_t from = in_group[edge.source];
      if (to == kNone || from == kNone) continue;
      measures_scale_ = measures_scale_ || edge.covariance(6, 6) > 4.0 * kSameScale * kSameScale;
      // With C = L·Lᵀ the whitened error is L⁻¹·δ.
      const Matrix7 root = Eigen::LLT<Matrix7>(edge.covariance).matrixL();
      const Matrix7 inverse_root =
          root.triangularView<Eigen::Lower>().solve(Matrix7::Identity().eval());
      Block& target = blocks_[to];
      Block& source = blocks_[from];
      graph_.AddResidualBlock(new ceres::AutoDiffCostFunction<LinkCost, 7, 4, 3, 1, 4, 3, 1>(
                                  new LinkCost(edge.target_from_source, inverse_root)),
                              &loss_, target.q.data(), target.t.data(), &target.log_scale,
                              source.q.data(), source.t.data(), &source.log_scale);
    }
    Block& first = blocks_.front();
    graph_.SetParameterBlockConstant(first.q.data());
    graph_.SetParameterBlockConstant(first.t.data());
    for (std::size_t i = 0; i < blocks_.size(); ++i) {
      // Maps of one unit stay so.
      if (i == 0 || !measures_scale_) graph_.SetParameterBlockConstant(&blocks_[i].log_scale);
    }
  }

  std::vector<Similarity3> solve(int max_iterations, double tolerance) {
    ceres::Solver::Options how;
    how.linear_solver_type = ceres::SPARSE_NORMAL_CHOLESKY;
    how.max_num_iterations = max_iterations;
    how.num_threads = 1;
    how.logging_type = ceres::SILENT;
    how.function_tolerance = tolerance;
    ceres::Solver::Summary summary;
    ceres::Solve(how, &graph_, &summary);
    std::vector<Similarity3> poses;
    for (const Block& block : blocks_) poses.push_back(to_pose(block));
    return poses;
  }

  // Of each pose, relative to the first.
  std::vector<Matrix7d> covariances() {
    std::vector<Matrix7d> result(blocks_.size(), Matrix7d::Zero());
    if (blocks_.size() < 2) return result;
    ceres::Problem::EvaluateOptions what;
    for (std::size_t i = 1; i < blocks_.size(); ++i) {
      what.parameter_blocks.push_back(blocks_[i].t.data());
      what.parameter_blocks.push_back(blocks_[i].q.data());
      if (measures_scale_) what.parameter_blocks.push_back(&blocks_[i].log_scale);
    }
    ceres::CRSMatrix rows;
    graph_.Evaluate(what, nullptr, nullptr, nullptr, &rows);
    const Eigen::Map<const Eigen::SparseMatrix<double, Eigen::RowMajor>> jacobian(
        rows.num_rows, rows.num_cols, static_cast<Eigen::Index>(rows.values.size()),
        rows.rows.data(), rows.cols.data(), rows.values.data());
    const Eigen::SparseMatrix<double> columns = jacobian;
    const Eigen::SparseMatrix<double> information = columns.transpose() * columns;
    const SelectedInverse inverse(information);
    if (!inverse.is_valid()) {
      throw Error(ErrorKind::kInput, "pose graph", "its links do not determine the poses",
                  "links whose covariances can be inverted");
    }
    const Eigen::Index size = measures_scale_ ? 7 : 6;
    for (std::size_t i = 1; i < blocks_.size(); ++i) {
      const Eigen::Index at = static_cast<Eigen::Index>(i - 1) * size;
      for (Eigen::Index row = 0; row < size; ++row) {
        for (Eigen::Index column = 0; column < size; ++column) {
          // Ceres turns a quaternion by twice its tangent vector.
          const auto factor = [](Eigen::Index k) { return k >= 3 && k < 6 ? 2.0 : 1.0; };
          result[i](row, column) = factor(row) * factor(column) * inverse(at + row, at + column);
        }
      }
    }
    return result;
  }

 private:
  static ceres::Problem::Options ownership() {
    ceres::Problem::Options keep;
    keep.manifold_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
    keep.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
    return keep;
  }

  // Before the graph, which refers to them.
  std::vector<Block> blocks_;
  ceres::EigenQuaternionManifold unit_quaternions_;
  ceres::CauchyLoss loss_{std::sqrt(kUsual)};
  bool measures_scale_ = false;
  ceres::Problem graph_;
};

std::vector<std::size_t> indices_in(const PoseGroup& group, std::size_t nodes) {
  std::vector<std::size_t> in_group(nodes, kNone);
  for (std::size_t i = 0; i < group.nodes.size(); ++i) in_group[group.nodes[i]] = i;
  return in_group;
}

// Those of the group's nodes that its edges still connect with one another, as many as possible.
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
  // Edges that agree with the poses of a group, or of which it can be true that they do: as far as the edges'
  // covariances and those of the poses, if they are given, allow. The others would not move the poses, and
  // make solving slow.
  const auto possible = [&](const PoseGroup& group, const std::vector<std::size_t>& in_group,
                            const std::vector<Matrix7d>& covariances) {
    std::vector<PoseEdge> edges;
    for (const PoseEdge& edge : all) {
      const std::size_t target = in_group[edge.target];
      const std::size_t source = in_group[edge.source];
      if (target == kNone || source == kNone) continue;
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
    group.group_from_node = Problem(possible(group, in_group, {}), group.group_from_node, in_group)
                                .solve(kIterations, kTolerance);
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
  const auto solve = [&](const std::vector<PoseEdge>& edges, double tolerance) {
    group.group_from_node =
        Problem(edges, group.group_from_node, in_group).solve(options.max_iterations, tolerance);
  };
  const auto keep_connected = [&](std::vector<PoseEdge>& edges) {
    std::erase_if(edges, [&](const PoseEdge& edge) { return !agrees(edge); });
    group = largest_part(group, edges, in_group);
    in_group = indices_in(group, count);
    std::erase_if(edges, [&](const PoseEdge& edge) { return !agrees(edge); });
  };
  // First by what agrees; then all that can be true has its say. What disagrees with the poses that come of
  // it goes, and with it what it alone connects, until the rest is of one mind.
  std::vector<PoseEdge> edges = possible(group, in_group, {});
  solve(edges, 1e-6);
  keep_connected(edges);
  edges = possible(group, in_group, Problem(edges, group.group_from_node, in_group).covariances());
  for (std::size_t before = edges.size() + 1; edges.size() < before;) {
    before = edges.size();
    solve(edges, 1e-12);
    keep_connected(edges);
  }

  const Similarity3 first_from_group = group.group_from_node.front().inverse();
  for (Similarity3& pose : group.group_from_node) pose = first_from_group * pose;
  group.group_from_node.front() = Similarity3();
  const std::vector<Matrix7d> covariances =
      Problem(edges, group.group_from_node, in_group).covariances();
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
