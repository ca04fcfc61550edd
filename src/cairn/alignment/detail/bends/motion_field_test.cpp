// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/alignment/detail/bends/motion_field.hpp"

#include <gtest/gtest.h>

#include "support/rig_maps.hpp"

namespace cairn::detail {
namespace {

TEST(MotionField, MovesFramesOfARigWithTheirLead) {
  const LandmarkMap map = testing::rig_map();
  MotionField field;
  for (std::uint32_t i = 0; i < map.frame_count(); ++i) {
    field.keyframes.emplace_back(2.0, Rigid3::from_roll_pitch_yaw({1, 2, 3}, 0.01 * i, 0.2, 0.3));
  }
  const LandmarkMap bent = moved(map, field);
  EXPECT_LT(testing::off_rig(bent), 1e-13);
  EXPECT_EQ(bent.rigs()[0].mounts[1].translation, 2.0 * map.rigs()[0].mounts[1].translation);
  const RigidFrames rigid = rigid_frames(map.rigs(), map.frames());
  for (std::uint32_t i = 0; i < map.frame_count(); ++i) {
    if (!rigid.leads(i)) continue;
    EXPECT_LT(
        (bent.frames().translations[i] - field.keyframes[i] * map.frames().translations[i]).norm(),
        1e-13);
  }
}

}  // namespace
}  // namespace cairn::detail
