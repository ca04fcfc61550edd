// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <span>

#include <Eigen/Core>

namespace cairn {

/// Centre and extent of points without far outliers, because a single landmark at 1e9 would otherwise
/// determine both for the whole map.
struct CentralPart {
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();  ///< mean
  double radius = 0.0;                               ///< root mean square distance from the centre
};

/// Excludes points that are farther from the coordinate-wise median than 100 times the median of these
/// distances. Without such points, the centre equals centroid() bit for bit.
CentralPart central_part(std::span<const Eigen::Vector3d> points);

}  // namespace cairn
