// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <unordered_map>
#include <vector>

#include "cairn/map/landmark_map.hpp"

namespace cairn {

/// Rigidly coupled frames: captured by one rig at one instant.
struct RigidFrames {
  /// Per frame: the first frame of its rigid group; itself if alone.
  std::vector<std::uint32_t> lead;
  std::vector<Rigid3> camera_from_lead;  ///< per frame, from its rig's mounts

  bool leads(std::size_t frame) const { return lead[frame] == frame; }
};

RigidFrames rigid_frames(std::span<const Rig> rigs, const FrameTable& frames);

/// camera_from_rig of every camera in a rig.
std::unordered_map<CameraIndex, Rigid3> cameras_from_rigs(std::span<const Rig> rigs);

/// Recomputes each frame's pose from its lead's pose and its rig, e.g. after independent motion.
void hold_rigs(MapTables& tables);

}  // namespace cairn
