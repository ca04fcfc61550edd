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

/// The files of one OpenSfM data set.
struct OpenSfmSources {
  ByteSource* reconstruction = nullptr;  ///< must be there
  ByteSource* tracks = nullptr;          ///< tracks.csv: the observations; null where it is missing
};

/// Reads one of the reconstructions of an OpenSfM file (docs/formats.md): shots become frames, numbered
/// from 0 in the order of their names; points become landmarks of free scale.
/// @param part which reconstruction, from 0; nothing: the first
/// @throws Error (input) naming source, line or place, what was found and what was expected
LandmarkMap read_opensfm(const OpenSfmSources& sources, const std::optional<std::string>& part = {},
                         const MapReadOptions& options = {});

/// Writes a reconstruction and, where the map knows its observations, tracks.csv beside it.
/// @throws Error (input) naming a frame without a camera, image names that are not distinct, or a camera of a
///         model that OpenSfM does not have, (storage) if there is a tracks.csv
void write_opensfm(const LandmarkMap& map, const std::filesystem::path& path,
                   const MapWriteOptions& options = {});

/// The format "opensfm".
std::vector<MapFormat> opensfm_formats();

}  // namespace cairn
