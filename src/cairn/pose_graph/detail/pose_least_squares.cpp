// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/pose_graph/detail/pose_least_squares.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include <Eigen/Cholesky>

#include "cairn/core/error.hpp"

namespace cairn::detail {
namespace {

using Eigen::Index;

// 99.9 % quantile of chi-squared with 7 degrees of freedom: the scale of the robust loss.
constexpr double kUsual = 24.3;

// Derivative of the rotation vector of Exp(δ) Exp(v) by δ: the inverse of the left Jacobian of SO(3).
Eigen::Matrix3d rotation_vector_jacobian(const Eigen::Vector3d& v) {
  const double squared = v.squaredNorm();
  const double half = 0.5 * std::sqrt(squared);
  constexpr double kSmall = 1e-3;
  const double factor = half < kSmall ? 1.0 / 12.0 + squared / 720.0
                                      : (1.0 - half * std::cos(half) / std::sin(half)) / squared;
  const Eigen::Matrix3d cross = skew(v);
  return Eigen::Matrix3d::Identity() - 0.5 * cross + factor * cross * cross;
}

// The perturbation (δt, δφ, δ log s) of the edge's target_from_source that gives the poses'.
Eigen::Matrix<double, 7, 1> error_of(const PoseEdge& edge, const Similarity3& target,
                                     const Similarity3& source) {
  const Eigen::Quaterniond target_from_world = target.rigid().quaternion().conjugate();
  Eigen::Matrix<double, 7, 1> error;
  error.head<3>() =
      target_from_world * (source.translation() - target.translation()) / target.scale() -
      edge.target_from_source.translation();
  error.segment<3>(3) = rotation_log(target_from_world * source.rigid().quaternion() *
                                     edge.target_from_source.rigid().quaternion().conjugate());
  error[6] = std::log(source.scale() / (target.scale() * edge.target_from_source.scale()));
  return error;
}

}  // namespace

PoseLeastSquares::PoseLeastSquares(std::vector<PoseEdge> edges, std::vector<Similarity3> poses,
                                   std::size_t fixed)
    : edges_(std::move(edges)), poses_(std::move(poses)), fixed_(fixed) {
  whitening_.reserve(edges_.size());
  for (const PoseEdge& edge : edges_) {
    // Scales are estimated only if an edge measures one.
    if (edge.covariance(6, 6) > 4.0 * kSameScale * kSameScale) size_ = 7;
    const Matrix7 root = Eigen::LLT<Matrix7>(edge.covariance).matrixL();
    whitening_.push_back(root.triangularView<Eigen::Lower>().solve(Matrix7::Identity().eval()));
    if (edge.target >= fixed_ && edge.source >= fixed_) {
      places_.emplace_back(edge.target - fixed_, edge.source - fixed_);
    }
  }
  if (poses_.size() > fixed_) cholesky_.emplace(poses_.size() - fixed_, size_, places_);
}

double PoseLeastSquares::cost_of(const std::vector<Similarity3>& poses) const {
  double sum = 0.0;
  for (std::size_t i = 0; i < edges_.size(); ++i) {
    const PoseEdge& edge = edges_[i];
    const Vector7 error = whitening_[i] * error_of(edge, poses[edge.target], poses[edge.source]);
    sum += kUsual * std::log1p(error.squaredNorm() / kUsual);
  }
  return 0.5 * sum;
}

void PoseLeastSquares::linearise() {
  const auto moving = static_cast<Index>(poses_.size() - fixed_);
  diagonal_.setZero(size_, moving * size_);
  others_.resize(size_, static_cast<Index>(places_.size()) * size_);
  gradient_.setZero(moving * size_);
  Index place = 0;
  for (std::size_t i = 0; i < edges_.size(); ++i) {
    const PoseEdge& edge = edges_[i];
    const Similarity3& target = poses_[edge.target];
    const Similarity3& source = poses_[edge.source];
    const Vector7 error = error_of(edge, target, source);
    const Vector7 whitened = whitening_[i] * error;
    const double weight = 1.0 / (1.0 + whitened.squaredNorm() / kUsual);
    const Eigen::Matrix3d turn = target.rigid().rotation().transpose();
    const Eigen::Matrix3d shift = turn / target.scale();
    const Eigen::Vector3d between = source.translation() - target.translation();
    const Eigen::Matrix3d rotation = rotation_vector_jacobian(error.segment<3>(3)) * turn;
    Matrix7 by_source = Matrix7::Zero();
    by_source.topLeftCorner<3, 3>() = shift;
    by_source.block<3, 3>(3, 3) = rotation;
    by_source(6, 6) = 1.0;
    Matrix7 by_target = -by_source;
    by_target.block<3, 3>(0, 3) = shift * skew(between);
    by_target.block<3, 1>(0, 6) = -(shift * between);
    const Matrix7 root = std::sqrt(weight) * whitening_[i];
    by_source = (root * by_source).eval();
    by_target = (root * by_target).eval();
    const Vector7 weighted = std::sqrt(weight) * whitened;
    const auto add = [&](std::size_t pose, const Matrix7& by_pose) {
      if (pose < fixed_) return;
      const Index at = static_cast<Index>(pose - fixed_) * size_;
      const Matrix7 square = by_pose.transpose() * by_pose;
      diagonal_.middleCols(at, size_) += square.topLeftCorner(size_, size_);
      gradient_.segment(at, size_) += (by_pose.transpose() * weighted).head(size_);
    };
    add(edge.target, by_target);
    add(edge.source, by_source);
    if (edge.target < fixed_ || edge.source < fixed_) continue;
    const Matrix7 product = by_target.transpose() * by_source;
    others_.middleCols(place++ * size_, size_) = product.topLeftCorner(size_, size_);
  }
}

// The normal equations' matrix times a vector.
Eigen::VectorXd PoseLeastSquares::times(const Eigen::VectorXd& x) const {
  Eigen::VectorXd result(x.size());
  for (Index at = 0; at < x.size(); at += size_) {
    result.segment(at, size_).noalias() = diagonal_.middleCols(at, size_) * x.segment(at, size_);
  }
  for (std::size_t i = 0; i < places_.size(); ++i) {
    const auto block = others_.middleCols(static_cast<Index>(i) * size_, size_);
    const Index row = static_cast<Index>(places_[i].first) * size_;
    const Index column = static_cast<Index>(places_[i].second) * size_;
    result.segment(row, size_).noalias() += block * x.segment(column, size_);
    result.segment(column, size_).noalias() += block.transpose() * x.segment(row, size_);
  }
  return result;
}

bool PoseLeastSquares::factor(double damping) {
  Eigen::MatrixXd damped = diagonal_;
  if (damping > 0.0) {
    // The lower bound also fixes undetermined poses.
    constexpr double kLeast = 1e-6;
    for (Index i = 0; i < damped.cols(); ++i) {
      damped(i % size_, i) += damping * std::max(damped(i % size_, i), kLeast);
    }
  }
  has_factor_ = cholesky_->factor(damped, others_);
  return has_factor_;
}

// Conjugate gradients for a Gauss-Newton step, preconditioned by the factor of earlier equations.
bool PoseLeastSquares::iterate(Eigen::VectorXd& x) const {
  constexpr int kMost = 12;
  constexpr double kEnough = 1e-8;  // of the initial squared residual, in the factor's norm
  Eigen::VectorXd left = -gradient_;
  Eigen::VectorXd ahead = cholesky_->solve(left);
  Eigen::VectorXd direction = ahead;
  double length = left.dot(ahead);
  const double enough = kEnough * length;
  x.setZero(left.size());
  for (int i = 0; i < kMost; ++i) {
    if (!(length > enough)) return std::isfinite(length);
    const Eigen::VectorXd image = times(direction);
    const double far = length / direction.dot(image);
    x += far * direction;
    left -= far * image;
    ahead = cholesky_->solve(left);
    const double next = left.dot(ahead);
    direction = ahead + next / length * direction;
    length = next;
  }
  return length <= enough;
}

// With damping, there is never a factor to reuse.
std::optional<Eigen::VectorXd> PoseLeastSquares::step(double damping) {
  if (has_factor_) {
    Eigen::VectorXd x;
    if (iterate(x)) return x;
  }
  if (!factor(damping)) return std::nullopt;
  return cholesky_->solve(-gradient_);
}

std::vector<Similarity3> PoseLeastSquares::moved(const Eigen::VectorXd& step) const {
  std::vector<Similarity3> poses = poses_;
  for (std::size_t i = fixed_; i < poses.size(); ++i) {
    const Index at = static_cast<Index>(i - fixed_) * size_;
    const double scale = size_ == 7 ? poses[i].scale() * std::exp(step[at + 6]) : poses[i].scale();
    poses[i] = Similarity3(scale, poses[i].rigid().perturbed(Vector6d(step.segment<6>(at))));
  }
  return poses;
}

void PoseLeastSquares::solve(int max_iterations, double tolerance) {
  if (poses_.size() <= fixed_) return;
  constexpr double kLeastDamping = 1e-4;  // of the diagonal
  constexpr double kMostDamping = 1e8;
  // Negligible decrease of the cost, which is half a squared Mahalanobis distance.
  constexpr double kNothing = 1e-16;
  double cost = cost_of(poses_);
  double damping = 0.0;
  linearise();
  for (int i = 0; i < max_iterations && damping < kMostDamping; ++i) {
    const std::optional<Eigen::VectorXd> x = step(damping);
    const double expected = x ? -0.5 * gradient_.dot(*x) : 0.0;
    std::vector<Similarity3> poses = x ? moved(*x) : poses_;
    const double moved_cost = x ? cost_of(poses) : cost;
    const bool is_last = x && expected <= std::max(kNothing, tolerance * cost);
    if (!x || !(moved_cost <= cost)) {
      if (is_last) return;
      damping = std::max(kLeastDamping, 10.0 * damping);
      has_factor_ = false;
      continue;
    }
    poses_ = std::move(poses);
    cost = moved_cost;
    if (is_last) return;
    if (damping > 0.0) {
      has_factor_ = false;
      damping = damping > kLeastDamping ? 0.1 * damping : 0.0;
    }
    linearise();
  }
}

std::vector<Matrix7d> PoseLeastSquares::covariances() {
  std::vector<Matrix7d> result(poses_.size(), Matrix7d::Zero());
  if (poses_.size() <= fixed_) return result;
  linearise();
  reject_if(!factor(0.0), "pose graph", "its links do not determine the poses",
            "links whose covariances can be inverted");
  const Eigen::MatrixXd blocks = cholesky_->inverse_diagonal();
  for (std::size_t i = fixed_; i < poses_.size(); ++i) {
    result[i].topLeftCorner(size_, size_) =
        blocks.middleCols(static_cast<Index>(i - fixed_) * size_, size_);
  }
  return result;
}

}  // namespace cairn::detail
