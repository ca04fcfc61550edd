// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <span>

#include "cairn/geometry/trajectory.hpp"

namespace cairn::detail {

/// A keyframe's pose before and after a correction.
struct CorrectedKeyframe {
  double timestamp_s = 0.0;
  Rigid3 before;  ///< world_from_camera
  Rigid3 after;
};

/// The trajectory after its keyframes were moved. Each pose keeps its pose relative to the keyframe before
/// it and to the keyframe after it; the two results are interpolated by time. Before the first and after
/// the last keyframe, only the nearest keyframe counts.
/// @param keyframes in the order of time, each once
/// @throws Error (misuse) if the keyframes are not in this order, or if there are none
Trajectory corrected(const Trajectory& trajectory, std::span<const CorrectedKeyframe> keyframes);

}  // namespace cairn::detail
