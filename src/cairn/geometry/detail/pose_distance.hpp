// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <span>

#include <Eigen/Core>

#include "cairn/geometry/similarity3.hpp"

namespace cairn {

/// Root mean square distance between the positions that two poses give the same points. Assumes that the
/// points are spread isotropically about their centroid.
struct PoseDistance {
  Eigen::Vector3d centroid = Eigen::Vector3d::Zero();
  double radius = 0.0;  ///< root mean square distance of the points from their centroid

  /// @param points at least one; far outliers are ignored, see central_part()
  static PoseDistance of(std::span<const Eigen::Vector3d> points);

  double operator()(const Similarity3& a, const Similarity3& b) const;
};

}  // namespace cairn
