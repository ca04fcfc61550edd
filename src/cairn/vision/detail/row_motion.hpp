// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>

#include "cairn/geometry/rigid3.hpp"

namespace cairn::detail {

/// How the camera moves while an image is read out row by row (a rolling shutter): at constant velocity.
/// The image's time, and its pose, are those of its middle row.
struct RowMotion {
  double readout_s = 0.0;  ///< from the first row to the last; 0: all rows at once
  double rows = 1.0;       ///< of the image
  Eigen::Vector3d velocity_m_s = Eigen::Vector3d::Zero();  ///< of the camera, in its axes
  Eigen::Vector3d turn_rad_s = Eigen::Vector3d::Zero();    ///< angular velocity, in its axes

  /// Whether all rows see the same, as without motion.
  bool none() const {
    return !(readout_s > 0.0) || (velocity_m_s.isZero(0.0) && turn_rad_s.isZero(0.0));
  }
  /// Time at which row `v` was read out, relative to the middle row.
  double time_of_row(double v) const { return readout_s * ((v + 0.5) / rows - 0.5); }
  /// Where the middle row would have seen a point that row `v` saw at `x_in_camera`.
  Eigen::Vector3d at_middle(const Eigen::Vector3d& x_in_camera, double v) const;
  /// The inverse of at_middle().
  Eigen::Vector3d at_row(const Eigen::Vector3d& x_in_camera, double v) const;
};

/// The constant velocity, in the axes of the second camera, that takes a camera from one pose to another.
/// @param previous_from_next the second pose in the first camera
/// @param duration_s         positive
RowMotion motion_between(const Rigid3& previous_from_next, double duration_s);

/// The pose after some time at a constant velocity, in the first camera: the inverse of motion_between().
Rigid3 motion_during(const RowMotion& motion, double duration_s);

}  // namespace cairn::detail
