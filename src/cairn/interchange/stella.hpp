// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "cairn/core/file.hpp"
#include "cairn/map/io/format_registry.hpp"
#include "cairn/map/io/options.hpp"
#include "cairn/map/landmark_map.hpp"

namespace cairn {

/// Reads a map of stella_vslam or OpenVSLAM in MessagePack (docs/formats.md): keyframes become frames, sorted
/// by id as landmarks are. Undistorted keypoints become pixels of the image.
/// @throws Error (input) naming source, byte, field, what was found and what was expected
LandmarkMap read_stella(ByteSource& source, const MapReadOptions& options = {});

/// Writes a map of stella_vslam in MessagePack: only the keypoints that see a landmark.
/// @throws Error (input) if a frame has no camera, or one of a model that stella_vslam does not have
void write_stella(const LandmarkMap& map, const ByteSink& sink,
                  const MapWriteOptions& options = {});

/// The format "stella".
std::vector<MapFormat> stella_formats();

}  // namespace cairn
