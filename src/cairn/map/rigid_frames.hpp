// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <unordered_map>
#include <vector>

#include "cairn/map/landmark_map.hpp"

namespace cairn {

/// Frames that move together: those that one rig took at one instant.
struct RigidFrames {
  /// Per frame: the first one that moves with it; itself if it moves alone.
  std::vector<std::uint32_t> lead;
  std::vector<Rigid3> camera_from_lead;  ///< per frame, as its rig states it

  bool leads(std::size_t frame) const { return lead[frame] == frame; }
};

RigidFrames rigid_frames(std::span<const Rig> rigs, const FrameTable& frames);

/// camera_from_rig of all cameras of rigs.
std::unordered_map<CameraIndex, Rigid3> cameras_from_rigs(std::span<const Rig> rigs);

/// Puts each frame where its rig has it relative to its lead, as after each frame was moved by itself.
void hold_rigs(MapTables& tables);

}  // namespace cairn
