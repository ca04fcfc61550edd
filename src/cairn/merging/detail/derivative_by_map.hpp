// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "cairn/geometry/similarity3.hpp"

namespace cairn {

/// Derivative of a point x = s·R·x' + t of a map by a left perturbation (δt, δφ, δ log s) of the map's pose:
/// x moves by δt, δφ × (x - t) and δ log s · (x - t).
/// @param arm x - t
inline Eigen::Matrix<double, 3, 7> derivative_by_map(const Eigen::Vector3d& arm) {
  Eigen::Matrix<double, 3, 7> by_map;
  by_map << Eigen::Matrix3d::Identity(), -skew(arm), arm;
  return by_map;
}

/// Covariance of another point's frame that moves rigidly with the map: of (δt, δφ, δ log s) there.
/// @param from the point whose motion is δt in `covariance`, in the world
inline Matrix7d carried_covariance(const Matrix7d& covariance, const Eigen::Vector3d& from,
                                   const Eigen::Vector3d& to) {
  Eigen::Matrix<double, 7, 7> by_map = Eigen::Matrix<double, 7, 7>::Identity();
  by_map.topRows<3>() = derivative_by_map(to - from);
  return by_map * covariance * by_map.transpose();
}

}  // namespace cairn
