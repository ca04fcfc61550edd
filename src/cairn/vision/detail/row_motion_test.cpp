// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/vision/detail/row_motion.hpp"

#include <gtest/gtest.h>

namespace cairn::detail {
namespace {

RowMotion turning() {
  RowMotion motion;
  motion.readout_s = 0.03;
  motion.rows = 240.0;
  motion.velocity_m_s = {0.4, -0.2, 0.1};
  motion.turn_rad_s = {0.5, 2.0, -1.0};
  return motion;
}

TEST(RowMotion, RowsSeeFromWhereTheCameraIsThen) {
  const RowMotion motion = turning();
  const Eigen::Vector3d x_in_middle(0.3, -0.2, 1.7);
  for (const double v : {0.0, 60.0, 119.5, 200.0, 239.0}) {
    const double time = 0.03 * ((v + 0.5) / 240.0 - 0.5);
    const Rigid3 middle_from_row(rotation_exp(time * motion.turn_rad_s),
                                 Eigen::Vector3d(time * motion.velocity_m_s));
    const Eigen::Vector3d x_in_row = middle_from_row.inverse() * x_in_middle;
    EXPECT_LT((motion.at_row(x_in_middle, v) - x_in_row).norm(), 1e-12) << v;
    EXPECT_LT((motion.at_middle(x_in_row, v) - x_in_middle).norm(), 1e-12) << v;
  }
  EXPECT_LT((motion.at_row(x_in_middle, 119.5) - x_in_middle).norm(), 1e-12) << "the middle row";
  EXPECT_GT((motion.at_row(x_in_middle, 0.0) - x_in_middle).norm(), 0.03) << "a first row";
}

TEST(RowMotion, IsNoneWithoutReadoutOrMotion) {
  RowMotion motion = turning();
  EXPECT_FALSE(motion.none());
  motion.readout_s = 0.0;
  EXPECT_TRUE(motion.none());
  motion = turning();
  motion.velocity_m_s.setZero();
  EXPECT_FALSE(motion.none());
  motion.turn_rad_s.setZero();
  EXPECT_TRUE(motion.none());
}

TEST(RowMotion, TheVelocityBetweenTwoPosesTakesOneToTheOther) {
  const Eigen::Vector3d turn(0.02, -0.06, 0.03);
  const Rigid3 previous_from_next(rotation_exp(turn), {0.01, 0.02, -0.03});
  const RowMotion motion = motion_between(previous_from_next, 0.1);
  EXPECT_LT((motion.turn_rad_s - turn / 0.1).norm(), 1e-9);
  // In the axes of the second camera.
  EXPECT_LT((previous_from_next.quaternion() * motion.velocity_m_s * 0.1 -
             previous_from_next.translation())
                .norm(),
            1e-12);
  EXPECT_LT(motion_during(motion, 0.1).difference_to(previous_from_next).norm(), 1e-12);
  EXPECT_LT((motion_during(motion, 0.05) * motion_during(motion, 0.05))
                .difference_to(previous_from_next)
                .norm(),
            1e-3);
}

}  // namespace
}  // namespace cairn::detail
