// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <span>
#include <vector>

#include "cairn/geometry/similarity3.hpp"

namespace cairn {

/// Each of the points, moved by the pose.
inline std::vector<Eigen::Vector3d> moved_points(std::span<const Eigen::Vector3d> points,
                                                 const Similarity3& pose) {
  const Eigen::Matrix3d linear = pose.linear();
  std::vector<Eigen::Vector3d> moved;
  moved.reserve(points.size());
  for (const Eigen::Vector3d& point : points) {
    moved.emplace_back(linear * point + pose.translation());
  }
  return moved;
}

}  // namespace cairn
