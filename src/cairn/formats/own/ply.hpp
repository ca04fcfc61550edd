// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "cairn/core/file.hpp"
#include "cairn/formats/options.hpp"
#include "cairn/map/landmark_map.hpp"

namespace cairn {

struct PlyWriteOptions {
  bool ascii = false;  ///< text instead of binary_little_endian
};

/// Reads the vertices of a PLY 1.0 file as landmarks (docs/formats.md lists the properties).
/// @throws Error (input) naming source, line or byte, value and constraint
LandmarkMap read_ply(ByteSource& source, const MapReadOptions& options = {});

/// Writes the landmarks as PLY 1.0 vertices: position, covariance, colour, count, named columns.
void write_ply(const LandmarkMap& map, const ByteSink& sink, const PlyWriteOptions& options = {});

}  // namespace cairn
