// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <string_view>

#include "cairn/map/landmark_map.hpp"

namespace cairn {

/// A UUID (RFC 9562, version 8) made of a hash of the bytes: the same bytes, the same UUID.
std::string uuid_of(std::string_view bytes);

/// One that is made of what a map holds, but for its own UUID: of its bytes in the binary format. What the
/// same inputs, options and seed produce has the same.
std::string content_uuid(const LandmarkMap& map);

/// The map with that UUID.
LandmarkMap with_content_uuid(LandmarkMap map);

}  // namespace cairn
