// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>

#include "cairn/core/file.hpp"
#include "cairn/map/io/options.hpp"
#include "cairn/map/landmark_map.hpp"

namespace cairn {

/// Reads Cairn's own text format, version 1 or 2 (docs/formats.md).
/// @throws Error (input) naming source, line, field, what was found and what was expected
LandmarkMap read_native(ByteSource& source, const MapReadOptions& options = {});

/// What version 1 of the text format cannot hold of `map`, in words; nothing if it holds all.
std::optional<std::string> version_1_loss(const LandmarkMap& map);

/// Writes Cairn's own text format.
/// @param version 1 or 2; nothing: 1 where it holds all of the map, else 2
/// @throws Error (misuse) if version 1 is asked for and would lose something
void write_native(const LandmarkMap& map, const ByteSink& sink,
                  std::optional<int> version = std::nullopt, const Progress& progress = {});

}  // namespace cairn
