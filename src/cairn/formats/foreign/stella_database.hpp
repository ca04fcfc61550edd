// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <vector>

#include "cairn/formats/format_registry.hpp"
#include "cairn/formats/options.hpp"
#include "cairn/map/landmark_map.hpp"

namespace cairn {

/// Reads an SQLite map of stella_vslam, with the same content as its MessagePack (stella.hpp).
/// @throws Error (input) naming file, table, row, value and constraint
LandmarkMap read_stella_database(const std::filesystem::path& path,
                                 const MapReadOptions& options = {});

/// The format "stella-database".
std::vector<MapFormat> stella_database_formats();

}  // namespace cairn
