// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <span>

#include <Eigen/Core>

#include "cairn/geometry/similarity3.hpp"

namespace cairn {

/// How far apart two poses put the same points: root mean square of the distances between the two
/// places of a point, for points that lie about their centroid as a ball does.
struct PoseDistance {
  Eigen::Vector3d centroid = Eigen::Vector3d::Zero();
  double radius = 0.0;  ///< root mean square distance of the points from their centroid

  /// For these points, at least one.
  static PoseDistance of(std::span<const Eigen::Vector3d> points);

  double operator()(const Similarity3& a, const Similarity3& b) const;
};

}  // namespace cairn
