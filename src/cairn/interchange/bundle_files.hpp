// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "cairn/core/file.hpp"
#include "cairn/map/io/format_registry.hpp"
#include "cairn/map/io/options.hpp"
#include "cairn/map/landmark_map.hpp"

// Formats whose observations are relative to the centre of an image of unstated size (docs/formats.md). The
// camera gets the smallest size, symmetric about the centre, that holds its observations.
namespace cairn {

/// Reads a Bundler file, version 0.3: cameras become frames, numbered from 0.
/// @throws Error (input) naming source, line, field, what was found and what was expected
LandmarkMap read_bundler(ByteSource& source, const MapReadOptions& options = {});

/// Reads a problem of Bundle Adjustment in the Large.
/// @throws Error (input) as read_bundler
LandmarkMap read_bal(ByteSource& source, const MapReadOptions& options = {});

/// Reads the first model of an NVM file of VisualSFM, version 3.
/// @throws Error (input) as read_bundler
LandmarkMap read_nvm(ByteSource& source, const MapReadOptions& options = {});

/// Writes a Bundler file, version 0.3. Observations of cameras that are not RADIAL are undistorted.
/// @throws Error (input) naming a frame without a camera
void write_bundler(const LandmarkMap& map, const ByteSink& sink,
                   const MapWriteOptions& options = {});

/// Writes an NVM file of one model. Observations are undistorted: VisualSFM's distortion is another.
/// @throws Error (input) naming a frame without a camera
void write_nvm(const LandmarkMap& map, const ByteSink& sink, const MapWriteOptions& options = {});

/// The formats "bundler", "bal" and "nvm".
std::vector<MapFormat> bundle_file_formats();

}  // namespace cairn
