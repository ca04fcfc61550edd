// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>

#include "cairn/geometry/rigid3.hpp"

namespace cairn::detail {

/// Derivative of a residual with respect to the camera's pose (left perturbation δt, δφ of
/// world_from_camera), from its derivative with respect to the point in the world.
/// @param arm vector from the camera's centre to the point, in the world
template <class Rows>
Eigen::Matrix<double, Rows::RowsAtCompileTime, 6> derivative_by_pose(
    const Eigen::MatrixBase<Rows>& by_point, const Eigen::Vector3d& arm) {
  Eigen::Matrix<double, Rows::RowsAtCompileTime, 6> by_pose;
  by_pose.template leftCols<3>() = -by_point;
  by_pose.template rightCols<3>() = by_point * skew(arm);
  return by_pose;
}

}  // namespace cairn::detail
