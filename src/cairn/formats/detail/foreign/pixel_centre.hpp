// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>

#include "cairn/map/camera.hpp"

namespace cairn::detail {

/// Coordinates of the centre of the top-left pixel in COLMAP, kapture and nerfstudio. In Cairn they are 0.
inline constexpr double kPixelCentre = 0.5;

/// Index of cx, followed by cy, among a camera's parameters; the focal lengths are before it.
std::size_t centre_place(const Camera& camera);

/// Adds `by` pixels to both coordinates of the principal point; the camera's model must be known.
void shift_centre(Camera& camera, double by);

}  // namespace cairn::detail
