// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "bindings/support.hpp"

namespace cairn::python {

/// Blue, green and red of each pixel of an image, which must have the camera's size.
/// @param given    (h, w) or (h, w, 3) uint8
/// @param channels "rgb" or "bgr"
std::vector<std::uint8_t> image_of(py::handle given, const Camera& camera,
                                   const std::string& channels);

/// Depth in metres, 0 where unknown; empty for None.
std::vector<float> depth_of(py::handle given, const Camera& camera);

}  // namespace cairn::python
