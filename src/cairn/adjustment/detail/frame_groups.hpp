// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "cairn/adjustment/measurements.hpp"

namespace cairn {

/// Frames that share landmarks, directly or by way of others.
struct FrameGroup {
  std::vector<std::uint32_t> frames;     ///< ascending; the first is the gauge
  std::vector<std::uint32_t> landmarks;  ///< ascending
  /// Where no depth determines the scale: the frame farthest from the first.
  std::optional<std::uint32_t> scale_frame;
};

/// In the order of their first frames. A landmark of fewer than `min_observations` ties no frames, but is in
/// the group of its first frame. Frames without observations are in no group.
std::vector<FrameGroup> frame_groups(const LandmarkMap& map,
                                     std::span<const std::vector<Measurement>> measurements,
                                     std::size_t min_observations);

}  // namespace cairn
