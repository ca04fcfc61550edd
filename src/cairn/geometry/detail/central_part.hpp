// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <span>

#include <Eigen/Core>

namespace cairn {

/// Where points are and how far they reach, by all of them but far outliers: what a single landmark at
/// 1e9 would otherwise decide for the whole map.
struct CentralPart {
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();  ///< mean of the points
  double radius = 0.0;                               ///< root mean square distance from it
};

/// The central part of points: without those farther from their median, axis by axis, than 100 times the
/// median of such distances. Where there are no far outliers, the mean is exactly the centroid.
CentralPart central_part(std::span<const Eigen::Vector3d> points);

}  // namespace cairn
