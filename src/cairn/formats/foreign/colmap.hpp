// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <vector>

#include "cairn/core/file.hpp"
#include "cairn/formats/format_registry.hpp"
#include "cairn/formats/options.hpp"
#include "cairn/map/landmark_map.hpp"

namespace cairn {

enum class ColmapForm { kBinary, kText };

/// The files of a COLMAP model; null if missing.
struct ColmapSources {
  ByteSource* cameras = nullptr;
  ByteSource* images = nullptr;
  ByteSource* points = nullptr;  ///< required
  ByteSource* rigs = nullptr;    ///< only counted: Cairn keeps a pose for each image
};

/// Reads a COLMAP model (docs/formats.md): images become frames, 3D points landmarks of free scale, both
/// sorted by id.
/// @throws Error (input) naming source, line or byte, field, value and constraint
LandmarkMap read_colmap(const ColmapSources& sources, ColmapForm form,
                        const MapReadOptions& options = {});

/// Reads the model in a folder.
LandmarkMap read_colmap(const std::filesystem::path& folder, ColmapForm form,
                        const MapReadOptions& options = {});

/// Writes a COLMAP model without rigs, which every version of COLMAP reads.
/// @param folder must be new or empty
/// @throws Error (input) if a frame has no camera, or a name that the form cannot represent, (storage)
void write_colmap(const LandmarkMap& map, const std::filesystem::path& folder, ColmapForm form,
                  const MapWriteOptions& options = {});

/// The formats "colmap" and "colmap-text".
std::vector<MapFormat> colmap_formats();

}  // namespace cairn
