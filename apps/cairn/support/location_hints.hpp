// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <string>

#include "cairn/map/landmark_map.hpp"
#include "cairn/vision/image_locator.hpp"

namespace cairn::cli {

/// Same as hints(), for an image that was not located: what to do about each way in which ImageLocator
/// refuses.
/// @param map map in which the image was searched
/// @param lens whether the image's lens was known; std::nullopt for images located together, whose lens must be
/// @param options options of the search
std::string location_hints(const ImageLocation& found, const LandmarkMap& map,
                           std::optional<FocalLength> lens, const LocateOptions& options);

}  // namespace cairn::cli
