// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/geometry/detail/pose_distance.hpp"

#include <cmath>

#include "cairn/geometry/detail/central_part.hpp"

namespace cairn {

PoseDistance PoseDistance::of(std::span<const Eigen::Vector3d> points) {
  PoseDistance distance;
  const CentralPart part = central_part(points);
  distance.centroid = part.centre;
  distance.radius = part.radius;
  return distance;
}

double PoseDistance::operator()(const Similarity3& a, const Similarity3& b) const {
  // For a ball: a rotation by φ moves points by 2·sin(φ/2) times their distance to the axis. The vector part of its
  // quaternion is sin(φ/2) long.
  const Eigen::Quaterniond turn = a.rigid().quaternion() * b.rigid().quaternion().conjugate();
  const double turned = 2.0 * turn.vec().norm() * radius;
  const double grown = (a.scale() - b.scale()) * radius;
  return std::sqrt((a * centroid - b * centroid).squaredNorm() + grown * grown +
                   2.0 / 3.0 * a.scale() * b.scale() * turned * turned);
}

}  // namespace cairn
