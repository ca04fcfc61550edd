// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "cairn/core/random.hpp"
#include "cairn/geometry/rigid3.hpp"

namespace cairn::benchmarks {

/// Any rotation, and a translation of up to so many units in any direction.
inline Rigid3 random_pose(Random& random, double most_translation) {
  Eigen::Quaterniond rotation(random.normal(), random.normal(), random.normal(), random.normal());
  Eigen::Vector3d direction(random.normal(), random.normal(), random.normal());
  return {rotation, random.uniform(0.0, most_translation) * direction.normalized()};
}

}  // namespace cairn::benchmarks
