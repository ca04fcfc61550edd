// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "cairn/geometry/similarity3.hpp"
#include "cairn/merging/detail/block_cholesky.hpp"
#include "cairn/merging/detail/grown_poses.hpp"

namespace cairn {

/// Deviation of the scale's logarithm in a link that does not measure it: maps of one unit.
inline constexpr double kSameScale = 1e-6;

/// Poses of nodes, the first of which are fixed, that minimise the edges' robust squared errors:
///   sum over the edges of rho(d' C^-1 d) / 2,  rho(x) = b log(1 + x / b),
/// with d the perturbation that the poses' target_from_source is of the edge's, C the edge's covariance, and b the
/// 99.9 % quantile of chi-squared with 7 degrees of freedom (Cauchy). Reweighted Gauss-Newton steps, damped
/// (Levenberg and Marquardt) where one fails. Scales stay unless an edge measures one.
///
/// A factor of the normal equations serves several steps: as preconditioner of conjugate gradients, until these
/// take too many iterations.
class PoseLeastSquares {
 public:
  /// @param edges whose ends are indices into `poses`
  /// @param fixed number of fixed poses, at least one
  PoseLeastSquares(std::vector<PoseEdge> edges, std::vector<Similarity3> poses,
                   std::size_t fixed = 1);

  const std::vector<Similarity3>& poses() const { return poses_; }

  /// Half the sum of the robust squared errors.
  double cost() const { return cost_of(poses_); }

  /// Moves the poses until a step lowers the cost by less than the tolerance, as a share of it.
  void solve(int max_iterations, double tolerance);

  /// Of each pose, relative to the fixed ones: left perturbation in the world, (δt, δφ, δ log s).
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
  std::vector<Matrix7> whitening_;  // by edge: L^-1, with the covariance L L'
  Eigen::Index size_ = 6;           // of a pose's perturbation
  // Normal equations about the poses, in blocks side by side. Fixed poses have none.
  Eigen::MatrixXd diagonal_;
  Eigen::MatrixXd
      others_;  // by edge between poses that move: row of the target, column of the source
  Eigen::VectorXd gradient_;
  std::vector<BlockCholesky::Place> places_;  // of the others
  std::optional<BlockCholesky> cholesky_;
  bool has_factor_ = false;
};

}  // namespace cairn
