// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <string_view>

#include "cairn/map/landmark_map.hpp"

namespace cairn {

/// A UUID (RFC 9562, version 8) from a hash of the bytes.
std::string uuid_of(std::string_view bytes);

/// UUID of a map's content without its own UUID: of its bytes in the binary format. Maps made with the same
/// inputs, options and seed have the same.
std::string content_uuid(const LandmarkMap& map);

/// The map with that UUID.
LandmarkMap with_content_uuid(LandmarkMap map);

}  // namespace cairn
