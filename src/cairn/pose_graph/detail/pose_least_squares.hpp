// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "cairn/geometry/similarity3.hpp"
#include "cairn/pose_graph/detail/block_cholesky.hpp"
#include "cairn/pose_graph/detail/grown_poses.hpp"

namespace cairn::detail {

/// Standard deviation of the scale's logarithm in a link that does not measure the scale, between maps of one
/// length unit.
inline constexpr double kSameScale = 1e-6;

/// Optimises the poses of nodes, of which the first are fixed, by minimising the edges' robust squared errors:
///   sum over the edges of rho(d' C^-1 d) / 2,  rho(x) = b log(1 + x / b)  (Cauchy),
/// with C the edge's covariance, d the perturbation from the edge's target_from_source to that of the poses,
/// and b the 99.9 % quantile of chi-squared with 7 degrees of freedom. Takes reweighted Gauss-Newton steps,
/// with Levenberg-Marquardt damping after a failed step. Scales are fixed unless an edge measures one.
///
/// A factor of the normal equations is reused in later steps to precondition conjugate gradients, until the
/// conjugate gradients need too many iterations.
class PoseLeastSquares {
 public:
  /// @param edges targets and sources are indices into `poses`
  /// @param fixed number of fixed poses, at least one
  PoseLeastSquares(std::vector<PoseEdge> edges, std::vector<Similarity3> poses,
                   std::size_t fixed = 1);

  const std::vector<Similarity3>& poses() const { return poses_; }

  /// Half the sum of the robust squared errors.
  double cost() const { return cost_of(poses_); }

  /// Iterates until the expected decrease of the cost is at most `tolerance` times the cost.
  void solve(int max_iterations, double tolerance);

  /// One per pose, relative to the fixed poses: covariance of the left perturbation in the world,
  /// (δt, δφ, δ log s).
  /// @throws Error (input) if the edges do not determine the poses
  std::vector<Matrix7d> covariances();

 private:
  using Matrix7 = Eigen::Matrix<double, 7, 7>;
  using Vector7 = Eigen::Matrix<double, 7, 1>;

  double cost_of(const std::vector<Similarity3>& poses) const;
  void linearise();
  Eigen::VectorXd times(const Eigen::VectorXd& x) const;
  bool factor(double damping);
  bool iterate(Eigen::VectorXd& x) const;
  std::optional<Eigen::VectorXd> step(double damping);
  std::vector<Similarity3> moved(const Eigen::VectorXd& step) const;

  std::vector<PoseEdge> edges_;
  std::vector<Similarity3> poses_;
  std::size_t fixed_;
  std::vector<Matrix7> whitening_;  // per edge: L^-1, with the covariance L L'
  Eigen::Index size_ = 6;           // size of a pose's perturbation
  // Normal equations at the current poses, in blocks side by side; none for fixed poses.
  Eigen::MatrixXd diagonal_;
  Eigen::MatrixXd
      others_;  // per edge between moving poses: row of the target, column of the source
  Eigen::VectorXd gradient_;
  std::vector<BlockCholesky::Place> places_;  // places of others_
  std::optional<BlockCholesky> cholesky_;
  bool has_factor_ = false;
};

}  // namespace cairn::detail
