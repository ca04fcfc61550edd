// SPDX-License-Identifier: BSD-3-Clause

#include <functional>
#include <string>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/core/error.hpp"
#include "cairn/map/operations.hpp"

#include "support/refusal.hpp"
#include "support/rig_maps.hpp"

namespace cairn {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using testing::off_rig;
using testing::refusal;
using testing::rig_map;

TEST(RigidFrames, AreThoseOfOneInstant) {
  const LandmarkMap map = rig_map({.instants = 3});
  const RigidFrames rigid = rigid_frames(map.rigs(), map.frames());
  EXPECT_THAT(rigid.lead, ElementsAre(0, 0, 2, 2, 4, 5));
  const Matrix4d stated = map.rigs()[0].mounts[1].camera_from_rig().matrix();
  EXPECT_LT((rigid.camera_from_lead[1].matrix() - stated).norm(), 1e-15);
  EXPECT_EQ(rigid.camera_from_lead[2].matrix(), Matrix4d::Identity());
  EXPECT_LT(off_rig(map), 1e-14);
}

TEST(RigidFrames, AreHeldWhereTheirLeadIs) {
  const LandmarkMap map = rig_map();
  MapTables tables = LandmarkMap(map).tables();
  tables.frames.translations[0] += Eigen::Vector3d(1, 2, 3);
  tables.frames.translations[1] += Eigen::Vector3d(5, 6, 7);
  hold_rigs(tables);
  const LandmarkMap held(std::move(tables));
  EXPECT_LT(off_rig(held), 1e-14);
  EXPECT_EQ(held.frames().translations[0], map.frames().translations[0] + Eigen::Vector3d(1, 2, 3));
  EXPECT_LT(
      (held.frames().translations[1] - map.frames().translations[1] - Eigen::Vector3d(1, 2, 3))
          .norm(),
      1e-14);
}

TEST(RigidFrames, OfAMovedMapAreThoseOfTheScaledRig) {
  const LandmarkMap map = rig_map();
  const LandmarkMap moved = transformed(
      map, Similarity3(2.5, Rigid3::from_roll_pitch_yaw({5.0, 6.0, 7.0}, 0.1, 0.2, 0.3)));
  EXPECT_LT(off_rig(moved), 1e-13);
  EXPECT_EQ(moved.rigs()[0].mounts[1].translation, 2.5 * map.rigs()[0].mounts[1].translation);
  EXPECT_EQ(moved.rigs()[0].mounts[1].quaternion, map.rigs()[0].mounts[1].quaternion);
  EXPECT_EQ(moved.frames().instants, map.frames().instants);
}

TEST(RigidFrames, AreCutWithTheirMap) {
  const LandmarkMap part = cut_frames(rig_map(), FrameId{2}, FrameId{5});
  EXPECT_EQ(part.rigs().size(), 1U);
  EXPECT_THAT(part.frames().instants, ElementsAre(InstantId{10}, InstantId{11}, InstantId{11}));
  EXPECT_LT(off_rig(part), 1e-14);
}

TEST(RigidFrames, OfOneCameraForAllAreNone) {
  const LandmarkMap map = with_camera(rig_map(), rig_map().cameras()[2]);
  EXPECT_TRUE(map.rigs().empty());
  EXPECT_TRUE(map.frames().instants.empty());
}

TEST(Rigs, ThatContradictThemselvesAreRefused) {
  struct Case {
    std::function<void(MapTables&)> change;
    std::string message;
  };
  for (const Case& c : std::vector<Case>{
           {[](MapTables& t) { t.rigs[0].mounts.clear(); }, "rig 4: has no camera"},
           {[](MapTables& t) { t.rigs[0].mounts[1].camera = CameraIndex{3}; },
            "rig 4: refers to a camera that the map does not have"},
           {[](MapTables& t) {
              t.rigs.push_back({RigId{5}, {{.camera = CameraIndex{1}}}});
            },
            "rig 5: camera 2 is in a rig already"},
           {[](MapTables& t) {
              t.rigs.push_back({RigId{4}, {{.camera = CameraIndex{2}}}});
            },
            "rig 4: the id occurs twice"},
           {[](MapTables& t) { t.rigs[0].mounts[0].quaternion[0] = 1.1; },
            "rig 4: quaternion of norm 1.1"},
           {[](MapTables& t) { t.rigs[0].mounts[0].translation[0] = 1e10; }, "rig 4: translation"},
           {[](MapTables& t) { t.frames.instants.pop_back(); }, "frame instants: 15 entries"},
           {[](MapTables& t) { t.frames.instants.back() = InstantId{3}; },
            "frame 16: has an instant, but no camera of a rig"},
           {[](MapTables& t) { t.frames.instants[2] = InstantId{10}; },
            "frame 3: instant 10 is that of frame 1 too, of the same camera"},
           {[](MapTables& t) {
              t.rigs.push_back({RigId{5}, {{.camera = CameraIndex{2}}}});
              t.frames.instants.back() = InstantId{10};
            },
            "frame 16: instant 10 is that of frame 2 too, of another rig"}}) {
    MapTables tables = rig_map().tables();
    c.change(tables);
    EXPECT_THAT(refusal(ErrorKind::kInput, [&] { LandmarkMap{std::move(tables)}; }),
                HasSubstr(c.message));
  }
}

}  // namespace
}  // namespace cairn
