// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>

#include "cairn/core/execution.hpp"
#include "cairn/map/landmark_map.hpp"
#include "cairn/vision/image.hpp"
#include "cairn/vision/sequence.hpp"

namespace cairn::detail {

/// The colour of the pixel at a place; std::nullopt outside the image.
std::optional<Color> color_at(const ColorImage& image, const Pixel& at);

/// The map with landmark colours: per channel, the median over the observing images, which is robust to
/// highlights and passing objects. Landmarks have no colour if no image of their keyframes can be read. The
/// UUID is that of the new content.
/// @param sequence sequence of the map; images are found by the keyframes' times
/// @throws Error (cancelled)
LandmarkMap with_colors(LandmarkMap map, const ImageSequence& sequence, const Execution& execution);

}  // namespace cairn::detail
