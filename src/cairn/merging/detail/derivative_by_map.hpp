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

}  // namespace cairn
