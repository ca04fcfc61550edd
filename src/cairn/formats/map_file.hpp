// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>

#include "cairn/formats/format_registry.hpp"
#include "cairn/formats/options.hpp"
#include "cairn/map/landmark_map.hpp"

namespace cairn {

/// Reads a map in one of the native_formats(), recognised by the first bytes.
/// @throws Error (input) naming the file, line or byte, field, value and constraint
LandmarkMap read_map(const std::filesystem::path& path, const MapReadOptions& options = {});

/// Writes a map in one of the native_formats(), atomically.
/// @throws Error (misuse) for an unknown extension, (storage) if the file cannot be written
void write_map(const LandmarkMap& map, const std::filesystem::path& path,
               const MapWriteOptions& options = {});

}  // namespace cairn
