// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <vector>

#include "cairn/formats/format_registry.hpp"
#include "cairn/formats/options.hpp"
#include "cairn/map/landmark_map.hpp"

// Formats that need SQLite. A build without it recognises databases and refuses them.
namespace cairn::detail {

/// The formats of databases.
std::vector<MapFormat> database_formats();

/// Adds descriptors to a COLMAP model from the database.db, or the only database of COLMAP, in its folder or in one of
/// the two parent folders. Returns the model unchanged if there is none.
LandmarkMap with_database_beside(LandmarkMap model, const std::filesystem::path& folder,
                                 const MapReadOptions& options);

}  // namespace cairn::detail
