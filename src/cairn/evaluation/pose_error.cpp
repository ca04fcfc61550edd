// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/evaluation/pose_error.hpp"

#include <Eigen/Cholesky>

#include "cairn/geometry/centroid.hpp"

namespace cairn {

PoseError pose_error(const Rigid3& estimate, const Rigid3& truth,
                     std::span<const Eigen::Vector3d> source) {
  const Eigen::Vector3d centre = centroid(source);
  return {(estimate.inverse() * truth).angle(), (estimate * centre - truth * centre).norm()};
}

double normalised_squared_error(const Rigid3& estimate, const Matrix6d& covariance,
                                const Rigid3& truth) {
  const Eigen::Matrix<double, 6, 1> error = estimate.difference_to(truth);
  return error.dot(Eigen::Matrix<double, 6, 6>(covariance).ldlt().solve(error));
}

}  // namespace cairn
