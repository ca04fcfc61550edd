// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>

#include "cairn/map/landmark_map.hpp"

namespace cairn::detail {

/// @param width, height size of the image of a frame
/// @throws Error (input) naming the image if its frame's camera has another size
void require_camera_size(const LandmarkMap& map, FrameIndex frame, std::uint32_t width,
                         std::uint32_t height);

/// Lengthens an optional column that is not left out.
template <class Column>
void extend(Column& column, std::size_t size) {
  if (!column.empty()) column.resize(size);
}

}  // namespace cairn::detail
