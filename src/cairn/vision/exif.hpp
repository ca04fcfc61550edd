// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <optional>
#include <string_view>

namespace cairn {

/// Focal length by the EXIF data of a photograph, in pixels of an image of this size. It follows
/// from the focal length of an equivalent 35 mm camera (CIPA DCG-001: equal angle along the
/// diagonal), or else from the focal length and the resolution of the sensor. std::nullopt without
/// these data. The result is not reliable, because programs that crop images keep the data.
/// @param bytes bytes of a JPEG file
std::optional<double> exif_focal_length(std::string_view bytes, std::uint32_t width,
                                        std::uint32_t height);

}  // namespace cairn
