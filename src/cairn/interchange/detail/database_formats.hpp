// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <vector>

#include "cairn/map/io/format_registry.hpp"
#include "cairn/map/io/options.hpp"
#include "cairn/map/landmark_map.hpp"

// What needs SQLite. Where Cairn is built without it, databases are refused by name.
namespace cairn::detail {

/// The formats of databases.
std::vector<MapFormat> database_formats();

/// A COLMAP model with the descriptors of the database.db in its folder or one of the two above it; the model
/// as it is where there is none.
LandmarkMap with_database_beside(LandmarkMap model, const std::filesystem::path& folder,
                                 const MapReadOptions& options);

}  // namespace cairn::detail
