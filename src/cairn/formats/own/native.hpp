// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>

#include "cairn/core/file.hpp"
#include "cairn/formats/options.hpp"
#include "cairn/map/landmark_map.hpp"

namespace cairn {

/// Reads Cairn's text format, version 1, 2 or 3 (docs/formats.md).
/// @throws Error (input) naming source, line, field, value and constraint
LandmarkMap read_native(ByteSource& source, const MapReadOptions& options = {});

/// What version 1 of the text format cannot hold of `map`, in words; std::nullopt if it can hold all.
std::optional<std::string> version_1_loss(const LandmarkMap& map);

/// Writes Cairn's text format.
/// @param version 1, 2 or 3; std::nullopt: the lowest that can hold the whole map
/// @throws Error (misuse) if the requested version cannot hold the map
void write_native(const LandmarkMap& map, const ByteSink& sink,
                  std::optional<int> version = std::nullopt, const Progress& progress = {});

}  // namespace cairn
