// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>

#include "cairn/map/camera.hpp"

namespace cairn::detail {

/// Coordinates of the centre of the top-left pixel in COLMAP, kapture and nerfstudio. In Cairn they are 0.
inline constexpr double kPixelCentre = 0.5;

/// Number of parameters of a camera's model before its principal point, cx and cy: the focal lengths.
std::size_t centre_place(const Camera& camera);

/// Shifts the principal point of a camera with a known model, in both coordinates, in pixels.
void shift_centre(Camera& camera, double by);

}  // namespace cairn::detail
