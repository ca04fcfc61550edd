// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <stop_token>

#include "cairn/core/executor.hpp"
#include "cairn/map/landmark_map.hpp"
#include "cairn/sequence/sequence.hpp"

namespace cairn {

/// The map with a colour for each landmark: of each channel the median over the images that observed it,
/// so that a highlight or something passing by in one of them does not count. Where no image of a keyframe
/// can be read, the landmarks that only it saw have none. The UUID is that of the new content.
/// @param sequence which the map was made of: images are found by the keyframes' times
/// @throws Error (cancelled)
LandmarkMap with_colors(LandmarkMap map, const RgbdSequence& sequence, const Executor& executor,
                        const std::stop_token& stop);

}  // namespace cairn
