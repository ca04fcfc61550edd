// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "cairn/core/execution.hpp"
#include "cairn/map/landmark_map.hpp"
#include "cairn/vision/sequence.hpp"

namespace cairn::detail {

/// The map with landmark colours: per channel, the median over the observing images, which is robust to
/// highlights and passing objects. Landmarks have no colour if no image of their keyframes can be read. The
/// UUID is that of the new content.
/// @param sequence sequence of the map; images are found by the keyframes' times
/// @throws Error (cancelled)
LandmarkMap with_colors(LandmarkMap map, const ImageSequence& sequence, const Execution& execution);

}  // namespace cairn::detail
