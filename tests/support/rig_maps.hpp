// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include <Eigen/Geometry>
#include <fmt/format.h>

#include "cairn/core/random.hpp"
#include "cairn/map/operations.hpp"

namespace cairn::testing {

struct RigScene {
  std::uint64_t seed = 1;
  std::uint32_t instants = 8;
  std::size_t landmarks = 150;
  double pixel_noise_px = 0.0;
};

/// A rig of two alike cameras, 0.4 apart and turned, on a path past landmarks. It takes both images at each instant but
/// the last. A third camera takes one image alone. Without depths.
inline LandmarkMap rig_map(const RigScene& scene = {}) {
  Random random(scene.seed);
  MapTables tables;
  tables.info.length_unit = LengthUnit::kFree;
  const std::vector<double> pinhole = {500, 500, 320, 240};
  tables.cameras = {{CameraId{1}, "PINHOLE", 640, 480, pinhole},
                    {CameraId{2}, "PINHOLE", 640, 480, pinhole},
                    {CameraId{3}, "PINHOLE", 640, 480, {510, 510, 320, 240}}};
  const Eigen::Quaterniond turned(Eigen::AngleAxisd(0.15, Eigen::Vector3d(0.2, 1, 0).normalized()));
  tables.rigs = {
      {RigId{4},
       {{CameraIndex{0}, {1, 0, 0, 0}, {0, 0, 0}},
        {CameraIndex{1}, {turned.w(), turned.x(), turned.y(), turned.z()}, {-0.4, 0.05, 0.02}}}}};
  FrameTable& frames = tables.frames;
  const auto add = [&](const Rigid3& world_from_camera, std::uint32_t camera,
                       std::optional<InstantId> instant) {
    const Eigen::Quaterniond q = world_from_camera.quaternion();
    frames.ids.push_back(FrameId{frames.ids.size() + 1});
    frames.image_names.push_back(fmt::format("{}.png", frames.ids.size()));
    frames.translations.push_back(world_from_camera.translation());
    frames.quaternions.push_back({q.w(), q.x(), q.y(), q.z()});
    frames.cameras.push_back(CameraIndex{camera});
    frames.instants.push_back(instant);
  };
  for (std::uint32_t i = 0; i < scene.instants; ++i) {
    const Rigid3 rig_from_world =
        Rigid3::from_roll_pitch_yaw({0.3 * i, 0.1 * random.normal(), 0.1 * random.normal()},
                                    0.05 * random.normal(), 0.1 * random.normal(), 0.0)
            .inverse();
    for (std::uint32_t k = 0; k < (i + 1 == scene.instants ? 1U : 2U); ++k) {
      add((tables.rigs[0].mounts[k].camera_from_rig() * rig_from_world).inverse(), k,
          InstantId{i + 10});
    }
  }
  add(Rigid3::from_roll_pitch_yaw({0.5, 0.5, -0.5}, 0.0, 0.0, 0.1), 2, std::nullopt);

  tables.observations.offsets = {0};
  for (std::uint32_t l = 0; l < scene.landmarks; ++l) {
    const Eigen::Vector3d x(random.uniform(-2.0, 4.0), random.uniform(-1.5, 1.5),
                            random.uniform(3.0, 8.0));
    tables.landmarks.ids.push_back(LandmarkId{l + 1});
    tables.landmarks.positions.push_back(x);
    for (std::uint32_t i = 0; i < frames.ids.size(); ++i) {
      const auto& q = frames.quaternions[i];
      const Rigid3 pose(Eigen::Quaterniond(q[0], q[1], q[2], q[3]), frames.translations[i]);
      const auto pixel = project(tables.cameras[frames.cameras[i]->value], pose.inverse() * x);
      if (!pixel || pixel->u < 0 || pixel->u > 640 || pixel->v < 0 || pixel->v > 480) continue;
      tables.observations.frames.push_back(FrameIndex{i});
      tables.observations.pixels.push_back({pixel->u + scene.pixel_noise_px * random.normal(),
                                            pixel->v + scene.pixel_noise_px * random.normal()});
    }
    tables.observations.offsets.push_back(tables.observations.frames.size());
  }
  return LandmarkMap(std::move(tables));
}

/// The largest element by which a pose relative to the lead of its rig differs from what the rig states.
inline double off_rig(const LandmarkMap& map) {
  const RigidFrames rigid = rigid_frames(map.rigs(), map.frames());
  double most = 0.0;
  for (std::uint32_t i = 0; i < map.frame_count(); ++i) {
    const Rigid3 camera_from_lead = map.world_from_camera(FrameIndex{i}).inverse() *
                                    map.world_from_camera(FrameIndex{rigid.lead[i]});
    const Matrix4d off = camera_from_lead.matrix() - rigid.camera_from_lead[i].matrix();
    most = std::max(most, off.cwiseAbs().maxCoeff());
  }
  return most;
}

}  // namespace cairn::testing
