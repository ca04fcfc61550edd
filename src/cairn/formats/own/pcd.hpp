// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "cairn/core/file.hpp"
#include "cairn/formats/options.hpp"
#include "cairn/map/landmark_map.hpp"

namespace cairn {

struct PcdWriteOptions {
  bool ascii = false;  ///< text instead of binary
  /// Positions as doubles instead of floats: exact, but PCL's point types cannot read them.
  bool double_precision = false;
};

/// Reads the points of a PCD 0.7 file as landmarks (docs/formats.md lists the fields).
/// @throws Error (input) naming source, line or byte, value and constraint
LandmarkMap read_pcd(ByteSource& source, const MapReadOptions& options = {});

/// Writes the landmarks as PCD 0.7 points: position, covariance, colour, count, named columns.
void write_pcd(const LandmarkMap& map, const ByteSink& sink, const PcdWriteOptions& options = {});

}  // namespace cairn
