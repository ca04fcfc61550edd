// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "cairn/core/file.hpp"
#include "cairn/map/io/format_registry.hpp"
#include "cairn/map/io/options.hpp"
#include "cairn/map/landmark_map.hpp"

namespace cairn {

/// The files of an OpenSfM data set.
struct OpenSfmSources {
  ByteSource* reconstruction = nullptr;  ///< required
  ByteSource* tracks = nullptr;          ///< tracks.csv, the observations; null if missing
};

/// Reads a reconstruction of an OpenSfM file (docs/formats.md): shots become frames, numbered from 0 in the
/// order of their names; points become landmarks of free scale.
/// @param part index of the reconstruction, from 0; std::nullopt: the first
/// @throws Error (input) naming source, line or place, value and constraint
LandmarkMap read_opensfm(const OpenSfmSources& sources, const std::optional<std::string>& part = {},
                         const MapReadOptions& options = {});

/// Writes a reconstruction and, if the map has observations, tracks.csv in the same folder.
/// @throws Error (input) naming a frame without a camera, duplicate image names, or a camera model that
///        OpenSfM lacks, (storage) if tracks.csv exists
void write_opensfm(const LandmarkMap& map, const std::filesystem::path& path,
                   const MapWriteOptions& options = {});

/// The format "opensfm".
std::vector<MapFormat> opensfm_formats();

}  // namespace cairn
