// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <vector>

#include "cairn/formats/format_registry.hpp"
#include "cairn/formats/options.hpp"
#include "cairn/map/landmark_map.hpp"

namespace cairn {

/// A COLMAP model with SIFT descriptors from COLMAP's database: for each landmark, the medoid of its first
/// eight observations' descriptors. Images are matched by name.
/// @param model from read_colmap, whose observations state their keypoint index
/// @throws Error (input) naming the database, if it is not one of COLMAP's
LandmarkMap with_colmap_descriptors(LandmarkMap model, const std::filesystem::path& database,
                                    const MapReadOptions& options = {});

/// The format "colmap-database": a database, read with the model in sparse/N in its folder, or where instant-ngp and
/// kapture have it.
std::vector<MapFormat> colmap_database_formats();

}  // namespace cairn
