// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/geometry/pose_distance.hpp"

#include <cmath>

#include <Eigen/Cholesky>

#include "cairn/geometry/centroid.hpp"

namespace cairn {

PoseDistance PoseDistance::of(std::span<const Eigen::Vector3d> points) {
  PoseDistance distance;
  distance.centroid = cairn::centroid(points);
  double sum = 0.0;
  for (const Eigen::Vector3d& point : points) sum += (point - distance.centroid).squaredNorm();
  distance.radius = std::sqrt(sum / static_cast<double>(points.size()));
  return distance;
}

double PoseDistance::operator()(const Rigid3& a, const Rigid3& b) const {
  // Of a ball: a turn by φ moves its points by 2·sin(φ/2) of their distance to the axis.
  const double angle = a.quaternion().angularDistance(b.quaternion());
  const double turned = 2.0 * std::sin(0.5 * angle) * radius;
  return std::sqrt((a * centroid - b * centroid).squaredNorm() + 2.0 / 3.0 * turned * turned);
}

Matrix6d inverse_covariance(const Rigid3& pose, const Matrix6d& covariance) {
  // (Exp(φ)R, t + δt) inverts to a turn of -Rᵀφ, and to a shift that the turn's arm is part of.
  const Rigid3 inverse = pose.inverse();
  const Eigen::Matrix3d rotation = inverse.rotation();
  Matrix6d jacobian = Matrix6d::Zero();
  jacobian.topLeftCorner<3, 3>() = -rotation;
  jacobian.topRightCorner<3, 3>() = skew(inverse.translation()) * rotation;
  jacobian.bottomRightCorner<3, 3>() = -rotation;
  const Matrix6d result = jacobian * covariance * jacobian.transpose();
  return 0.5 * (result + result.transpose());
}

double normalised_squared_error(const Rigid3& estimate, const Matrix6d& covariance,
                                const Rigid3& truth) {
  const Eigen::Matrix<double, 6, 1> error = estimate.difference_to(truth);
  return error.dot(Eigen::Matrix<double, 6, 6>(covariance).ldlt().solve(error));
}

}  // namespace cairn
