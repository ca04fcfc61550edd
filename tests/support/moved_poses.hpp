// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>

#include "cairn/core/random.hpp"
#include "cairn/geometry/similarity3.hpp"

namespace cairn::testing {

/// A pose at most 2 away on each axis, turned by any angle.
inline Rigid3 random_pose(Random& random) {
  const double x = random.uniform(-2.0, 2.0);
  const double y = random.uniform(-2.0, 2.0);
  const double z = random.uniform(-2.0, 2.0);
  const double roll = random.uniform(-3.0, 3.0);
  const double pitch = random.uniform(-1.0, 1.0);
  return Rigid3::from_roll_pitch_yaw({x, y, z}, roll, pitch, random.uniform(-3.0, 3.0));
}

/// @param direction 0 to 5: of Rigid3::perturbed(); 6: the logarithm of the scale
inline Similarity3 moved_along(const Similarity3& pose, int direction, double by) {
  if (direction == 6) return {pose.scale() * std::exp(by), pose.rigid()};
  Vector6d delta = Vector6d::Zero();
  delta[direction] = by;
  return {pose.scale(), pose.rigid().perturbed(delta)};
}

}  // namespace cairn::testing
