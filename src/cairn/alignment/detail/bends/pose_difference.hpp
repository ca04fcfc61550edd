// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>

#include "cairn/geometry/similarity3.hpp"

namespace cairn {

/// The left perturbation (δt, δφ, δ log s) that moves `from` to `to`.
inline Vector7d pose_difference(const Similarity3& from, const Similarity3& to) {
  Vector7d result;
  result << from.rigid().difference_to(to.rigid()), std::log(to.scale() / from.scale());
  return result;
}

}  // namespace cairn
