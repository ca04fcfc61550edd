// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <span>

#include "cairn/trajectory/trajectory.hpp"

namespace cairn {

/// Where a keyframe was taken to be, and where it is.
struct CorrectedKeyframe {
  double timestamp_s = 0.0;
  Rigid3 before;  ///< world_from_camera
  Rigid3 after;
};

/// The trajectory after its keyframes were moved. Each pose keeps its place relative to the keyframes before
/// and after it; between what the two say it is interpolated by time. Before the first and after the last
/// keyframe the nearest one decides.
/// @param keyframes in the order of time, each once
/// @throws Error (misuse) if they are not, or there are none
Trajectory corrected(const Trajectory& trajectory, std::span<const CorrectedKeyframe> keyframes);

}  // namespace cairn
