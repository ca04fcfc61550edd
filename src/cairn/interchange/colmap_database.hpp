// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <vector>

#include "cairn/map/io/format_registry.hpp"
#include "cairn/map/io/options.hpp"
#include "cairn/map/landmark_map.hpp"

namespace cairn {

/// A COLMAP model with a SIFT descriptor for each landmark that a keypoint of COLMAP's database has one for:
/// the medoid of its first eight observations' descriptors. Images are found by name.
/// @param model as read_colmap gave it: its observations state the index of their keypoint
/// @throws Error (input) naming the database, if it is none of COLMAP's
LandmarkMap with_colmap_descriptors(LandmarkMap model, const std::filesystem::path& database,
                                    const MapReadOptions& options = {});

/// The format "colmap-database": a database, read with the model in sparse/N beside it.
std::vector<MapFormat> colmap_database_formats();

}  // namespace cairn
