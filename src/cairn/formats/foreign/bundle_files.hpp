// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "cairn/core/file.hpp"
#include "cairn/formats/format_registry.hpp"
#include "cairn/formats/options.hpp"
#include "cairn/map/landmark_map.hpp"

// Formats whose observations are relative to the centre of an image of unknown size (docs/formats.md). The
// camera gets the smallest size, symmetric about the centre, that contains its observations.
namespace cairn {

/// Reads a Bundler file, version 0.3: cameras become frames, numbered from 0. Images have no names; the format "bundler"
/// takes them from a list.txt.
/// @throws Error (input) naming source, line, field, value and constraint
LandmarkMap read_bundler(ByteSource& source, const MapReadOptions& options = {});

/// Reads a problem of Bundle Adjustment in the Large.
/// @throws Error (input) as read_bundler
LandmarkMap read_bal(ByteSource& source, const MapReadOptions& options = {});

/// Reads the first model of an NVM file of VisualSFM, version 3.
/// @throws Error (input) as read_bundler
LandmarkMap read_nvm(ByteSource& source, const MapReadOptions& options = {});

/// Writes a Bundler file, version 0.3. Undistorts observations of cameras that are not RADIAL.
/// @throws Error (input) naming a frame without a camera
void write_bundler(const LandmarkMap& map, const ByteSink& sink,
                   const MapWriteOptions& options = {});

/// Writes an NVM file with one model. Undistorts observations, because VisualSFM has another distortion
/// model.
/// @throws Error (input) naming a frame without a camera
void write_nvm(const LandmarkMap& map, const ByteSink& sink, const MapWriteOptions& options = {});

/// The formats "bundler", "bal" and "nvm".
std::vector<MapFormat> bundle_file_formats();

}  // namespace cairn
