// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "cairn/core/file.hpp"
#include "cairn/formats/format_registry.hpp"
#include "cairn/formats/options.hpp"
#include "cairn/map/landmark_map.hpp"

namespace cairn {

/// The files of an OpenSfM data set.
struct OpenSfmSources {
  ByteSource* reconstruction = nullptr;  ///< required
  ByteSource* tracks = nullptr;          ///< tracks.csv, the observations; null if missing
  ByteSource* control_points = nullptr;  ///< ground_control_points.json; null if missing
  ByteSource* control_list = nullptr;    ///< gcp_list.txt, more control points; null if missing
};

/// Reads a reconstruction of an OpenSfM file (docs/formats.md): shots become frames, numbered from 0 in the
/// order of their names; points become landmarks of free scale.
/// @param part index of the reconstruction, from 0; std::nullopt: the first
/// @throws Error (input) naming source, line or place, value and constraint
LandmarkMap read_opensfm(const OpenSfmSources& sources, const std::optional<std::string>& part = {},
                         const MapReadOptions& options = {});

/// Writes a reconstruction and, if the map has any, its observations and control points in the same folder, as
/// tracks.csv and ground_control_points.json.
/// @throws Error (input) naming a frame without a camera, duplicate image names, or a camera model that
///        OpenSfM lacks, (storage) if tracks.csv exists, or ground_control_points.json that would be written
void write_opensfm(const LandmarkMap& map, const std::filesystem::path& path,
                   const MapWriteOptions& options = {});

/// The format "opensfm".
std::vector<MapFormat> opensfm_formats();

}  // namespace cairn
