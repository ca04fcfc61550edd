// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "cairn/geometry/rigid3.hpp"

namespace cairn {

/// An initial misalignment, as listed in experiments and tables: R = Rz(yaw)·Ry(pitch)·Rx(roll), then the
/// translation.
struct Displacement {
  double x_m = 0.0;
  double y_m = 0.0;
  double z_m = 0.0;
  double roll_deg = 0.0;
  double pitch_deg = 0.0;
  double yaw_deg = 0.0;

  Rigid3 pose() const;

  friend bool operator==(const Displacement&, const Displacement&) = default;
};

}  // namespace cairn
