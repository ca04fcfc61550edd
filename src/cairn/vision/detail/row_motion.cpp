// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/vision/detail/row_motion.hpp"

#include <Eigen/Geometry>

namespace cairn::detail {

Eigen::Vector3d RowMotion::at_middle(const Eigen::Vector3d& x_in_camera, double v) const {
  const double time = time_of_row(v);
  return rotation_exp(time * turn_rad_s) * x_in_camera + time * velocity_m_s;
}

Eigen::Vector3d RowMotion::at_row(const Eigen::Vector3d& x_in_camera, double v) const {
  const double time = time_of_row(v);
  return rotation_exp(-time * turn_rad_s) * (x_in_camera - time * velocity_m_s);
}

RowMotion motion_between(const Rigid3& previous_from_next, double duration_s) {
  RowMotion motion;
  motion.velocity_m_s =
      previous_from_next.quaternion().conjugate() * previous_from_next.translation() / duration_s;
  motion.turn_rad_s = rotation_log(previous_from_next.quaternion()) / duration_s;
  return motion;
}

Rigid3 motion_during(const RowMotion& motion, double duration_s) {
  const Eigen::Quaterniond turn(rotation_exp(duration_s * motion.turn_rad_s));
  return {turn, turn * (duration_s * motion.velocity_m_s)};
}

}  // namespace cairn::detail
