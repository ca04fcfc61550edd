// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "cairn/adjustment/detail/measurements.hpp"
#include "cairn/map/operations.hpp"

namespace cairn::detail {

/// Frames that share landmarks, directly or through other frames, and the frames that move rigidly with
/// these.
struct FrameGroup {
  std::vector<std::uint32_t> frames;     ///< ascending; the first fixes the gauge
  std::vector<std::uint32_t> landmarks;  ///< ascending
  /// The leading frame that is farthest from the first frame, if neither a depth nor a rig determines
  /// the scale.
  std::optional<std::uint32_t> scale_frame;
};

/// Groups in the order of their first frames. A landmark with fewer than `min_observations` connects no
/// frames, but belongs to the group of its first frame. Frames without observations are in no group.
std::vector<FrameGroup> frame_groups(const LandmarkMap& map, const RigidFrames& rigid,
                                     std::span<const std::vector<Measurement>> measurements,
                                     std::size_t min_observations);

}  // namespace cairn::detail
