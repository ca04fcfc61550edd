// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "cairn/core/file.hpp"
#include "cairn/formats/format_registry.hpp"
#include "cairn/formats/options.hpp"
#include "cairn/map/landmark_map.hpp"

namespace cairn {

/// Reads a map of stella_vslam or OpenVSLAM in MessagePack (docs/formats.md): keyframes become frames,
/// sorted by id like the landmarks. Undistorted keypoints are distorted to pixels of the image.
/// @throws Error (input) naming source, byte, field, value and constraint
LandmarkMap read_stella(ByteSource& source, const MapReadOptions& options = {});

/// Writes a map of stella_vslam in MessagePack, with only the keypoints of landmarks.
/// @throws Error (input) if a frame has no camera, or one whose model stella_vslam lacks
void write_stella(const LandmarkMap& map, const ByteSink& sink,
                  const MapWriteOptions& options = {});

/// The format "stella".
std::vector<MapFormat> stella_formats();

}  // namespace cairn
