// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <vector>

#include "cairn/core/file.hpp"
#include "cairn/formats/format_registry.hpp"
#include "cairn/formats/options.hpp"
#include "cairn/map/landmark_map.hpp"

namespace cairn {

/// Reads transforms.json of nerfstudio or instant-ngp (docs/formats.md): frames and cameras, numbered from
/// 0. The points of "ply_file_path" become landmarks.
/// @param folder to which the file's paths are relative
/// @throws Error (input) naming source, place, value and constraint
LandmarkMap read_nerfstudio(ByteSource& source, const std::filesystem::path& folder,
                            const MapReadOptions& options = {});

/// Writes transforms.json, and the landmarks as sparse_pc.ply in the same folder.
/// @throws Error (input) naming a frame without a camera, or a camera model that nerfstudio lacks,
///        (storage) if sparse_pc.ply exists
void write_nerfstudio(const LandmarkMap& map, const std::filesystem::path& path,
                      const MapWriteOptions& options = {});

/// The format "nerfstudio".
std::vector<MapFormat> nerfstudio_formats();

}  // namespace cairn
