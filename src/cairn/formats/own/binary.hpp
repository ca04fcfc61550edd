// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string_view>

#include "cairn/core/file.hpp"
#include "cairn/formats/options.hpp"
#include "cairn/map/landmark_map.hpp"

namespace cairn {

/// First bytes of Cairn's binary format. No text begins with them, and a transfer that converts line ends
/// breaks them.
inline constexpr std::string_view kBinaryMagic =
    "\x89"
    "CAIRN\r\n";

/// Reads Cairn's binary format (docs/formats.md), memory-mapped if the source can be.
/// @throws Error (input) naming source, byte, field, value and constraint
LandmarkMap read_binary(ByteSource& source, const MapReadOptions& options = {});

/// Writes Cairn's binary format.
/// @throws Error (misuse) if a text of the map has 2^32 bytes or more
void write_binary(const LandmarkMap& map, const ByteSink& sink, const Progress& progress = {});

}  // namespace cairn
