// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>

#include "cairn/geometry/decompositions.hpp"
#include "cairn/geometry/rigid3.hpp"

namespace cairn {

/// Normal equations of a small motion (δt, δφ) of matched points: x moves by δt + δφ × x. The sums need
/// only a few multiplications per match; for isotropic weights.
class PoseStep {
 public:
  /// @param x position of the point, relative to the motion's pivot
  /// @param residual from there to the target position
  void add(const Eigen::Vector3d& x, const Eigen::Vector3d& residual, double weight) {
    const Eigen::Vector3d weighted = weight * x;
    weight_ += weight;
    first_ += weighted;
    second_.noalias() += weighted * x.transpose();
    force_ += weight * residual;
    torque_ += weighted.cross(residual);
  }

  double weight() const { return weight_; }

  /// Least-squares motion, slightly damped, so that undetermined directions do not move.
  Vector6d solve() const {
    Eigen::Matrix<double, 6, 6> information;
    information.topLeftCorner<3, 3>() = weight_ * Eigen::Matrix3d::Identity();
    information.topRightCorner<3, 3>() = -skew(first_);
    information.bottomLeftCorner<3, 3>() = skew(first_);
    information.bottomRightCorner<3, 3>() = second_.trace() * Eigen::Matrix3d::Identity() - second_;
    information.diagonal().array() *= 1.0 + kDamping;
    Eigen::Matrix<double, 6, 1> gradient;
    gradient << force_, torque_;
    return solve_symmetric<6>(information, gradient);
  }

 private:
  static constexpr double kDamping = 1e-6;

  double weight_ = 0.0;
  Eigen::Vector3d first_ = Eigen::Vector3d::Zero();
  Eigen::Matrix3d second_ = Eigen::Matrix3d::Zero();
  Eigen::Vector3d force_ = Eigen::Vector3d::Zero();
  Eigen::Vector3d torque_ = Eigen::Vector3d::Zero();
};

}  // namespace cairn
