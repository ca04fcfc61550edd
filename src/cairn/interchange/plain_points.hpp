// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "cairn/core/file.hpp"
#include "cairn/map/io/format_registry.hpp"
#include "cairn/map/io/options.hpp"
#include "cairn/map/landmark_map.hpp"

namespace cairn {

/// Reads points as text, one a line: x, y and z, apart by blanks, commas or semicolons. A first line of names
/// says which column is which; without it the first three are x, y and z.
/// @throws Error (input) naming source, line, field, what was found and what was expected
LandmarkMap read_plain_points(ByteSource& source, const MapReadOptions& options = {});

/// Reads an array of NumPy, version 1 or 2 of the .npy format: N x 3 float32 or float64, row by row.
/// @throws Error (input) naming source, byte, what was found and what was expected
LandmarkMap read_npy_points(ByteSource& source, const MapReadOptions& options = {});

/// The formats "xyz" and "npy".
std::vector<MapFormat> plain_points_formats();

}  // namespace cairn
