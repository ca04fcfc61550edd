// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/experiments/displacement.hpp"

#include <numbers>

namespace cairn {

Rigid3 Displacement::pose() const {
  constexpr double kRadians = std::numbers::pi / 180.0;
  return Rigid3::from_roll_pitch_yaw({x_m, y_m, z_m}, roll_deg * kRadians, pitch_deg * kRadians,
                                     yaw_deg * kRadians);
}

}  // namespace cairn
