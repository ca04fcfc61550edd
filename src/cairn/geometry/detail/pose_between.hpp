// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>

#include "cairn/geometry/similarity3.hpp"

namespace cairn {

/// Interpolates between two poses: a at share 0, b at share 1. Rotations by slerp, translations linearly.
inline Rigid3 pose_between(const Rigid3& a, const Rigid3& b, double share) {
  return {a.quaternion().slerp(share, b.quaternion()),
          (1.0 - share) * a.translation() + share * b.translation()};
}

/// The same for similarities: scales geometrically; the image of the point `about` moves linearly.
inline Similarity3 pose_between(const Similarity3& a, const Similarity3& b, double share,
                                const Eigen::Vector3d& about) {
  const double scale = std::exp((1.0 - share) * std::log(a.scale()) + share * std::log(b.scale()));
  const Rigid3 turn(a.rigid().quaternion().slerp(share, b.rigid().quaternion()),
                    Eigen::Vector3d::Zero());
  const Eigen::Vector3d there = (1.0 - share) * (a * about) + share * (b * about);
  return {scale, Rigid3(turn.quaternion(), there - scale * (turn * about))};
}

}  // namespace cairn
