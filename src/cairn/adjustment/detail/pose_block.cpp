// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/adjustment/detail/pose_block.hpp"

#include <Eigen/Geometry>

namespace cairn::detail {

PoseBlock to_block(const Rigid3& pose) {
  const Eigen::Quaterniond q = pose.quaternion();
  const Eigen::Vector3d& t = pose.translation();
  return {q.x(), q.y(), q.z(), q.w(), t.x(), t.y(), t.z()};
}

Rigid3 to_pose(const double* block) {
  return {Eigen::Quaterniond(block[3], block[0], block[1], block[2]),
          Eigen::Vector3d(block[4], block[5], block[6])};
}

bool PoseManifold::Plus(const double* x, const double* delta, double* x_plus_delta) const {
  const Eigen::Map<const Eigen::Quaterniond> q(x);
  const Eigen::Quaterniond moved =
      (rotation_exp(Eigen::Vector3d(delta[3], delta[4], delta[5])) * q).normalized();
  Eigen::Map<Eigen::Vector4d>{x_plus_delta} = moved.coeffs();
  for (int i = 0; i < 3; ++i) x_plus_delta[4 + i] = x[4 + i] + delta[i];
  return true;
}

bool PoseManifold::PlusJacobian(const double* /*x*/, double* jacobian) const {
  Eigen::Map<Eigen::Matrix<double, 7, 6, Eigen::RowMajor>>(jacobian).setIdentity();
  return true;
}

bool PoseManifold::Minus(const double* y, const double* x, double* y_minus_x) const {
  const Eigen::Map<const Eigen::Quaterniond> to(y);
  const Eigen::Map<const Eigen::Quaterniond> from(x);
  for (int i = 0; i < 3; ++i) y_minus_x[i] = y[4 + i] - x[4 + i];
  Eigen::Map<Eigen::Vector3d>{y_minus_x + 3} = rotation_log(to * from.conjugate());
  return true;
}

bool PoseManifold::MinusJacobian(const double* /*x*/, double* jacobian) const {
  Eigen::Map<Eigen::Matrix<double, 6, 7, Eigen::RowMajor>>(jacobian).setIdentity();
  return true;
}

}  // namespace cairn::detail
