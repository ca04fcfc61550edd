// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string_view>

#include "cairn/core/file.hpp"
#include "cairn/map/io/options.hpp"
#include "cairn/map/landmark_map.hpp"

namespace cairn {

/// What a file in Cairn's binary format starts with. No text starts so, and a transfer that converts
/// line ends breaks it.
inline constexpr std::string_view kBinaryMagic =
    "\x89"
    "CAIRN\r\n";

/// Reads Cairn's own binary format (docs/formats.md) from where it lies, if the source can be mapped.
/// @throws Error (input) naming source, byte, field, what was found and what was expected
LandmarkMap read_binary(ByteSource& source, const MapReadOptions& options = {});

/// Writes Cairn's own binary format.
/// @throws Error (misuse) if a text of the map has 2^32 bytes or more
void write_binary(const LandmarkMap& map, const ByteSink& sink, const Progress& progress = {});

}  // namespace cairn
