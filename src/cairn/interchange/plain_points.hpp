// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "cairn/core/file.hpp"
#include "cairn/map/io/format_registry.hpp"
#include "cairn/map/io/options.hpp"
#include "cairn/map/landmark_map.hpp"

namespace cairn {

/// Reads points as text, one a line: x, y and z, apart by blanks, commas or semicolons. A first line of names
/// says which column is which: they are read as PLY's properties are (docs/formats.md). Without it the first
/// three are x, y and z.
/// @throws Error (input) naming source, line, field, what was found and what was expected
LandmarkMap read_plain_points(ByteSource& source, const MapReadOptions& options = {});

/// Reads an array of NumPy, version 1 to 3 of the .npy format: N x 3 float32 or float64, row by row.
/// @throws Error (input) naming source, byte, what was found and what was expected
LandmarkMap read_npy_points(ByteSource& source, const MapReadOptions& options = {});

/// Reads an archive of arrays as numpy.savez and savez_compressed write them: positions, and what else holds
/// an entry a point.
/// @throws Error (input) naming source and array, what was found and what was expected
LandmarkMap read_npz_points(ByteSource& source, const MapReadOptions& options = {});

/// Positions alone, one point a line.
void write_xyz_points(const LandmarkMap& map, const ByteSink& sink,
                      const MapWriteOptions& options = {});
/// A line of names, then a line a landmark: what PLY holds, apart by commas.
/// @throws Error (misuse) for a named column whose name stands for something else
void write_csv_points(const LandmarkMap& map, const ByteSink& sink,
                      const MapWriteOptions& options = {});
/// Positions as N x 3 float64.
void write_npy_points(const LandmarkMap& map, const ByteSink& sink,
                      const MapWriteOptions& options = {});
/// Positions, ids, covariances, colours, descriptors, named columns and counts of observations.
void write_npz_points(const LandmarkMap& map, const ByteSink& sink,
                      const MapWriteOptions& options = {});

/// The formats "xyz", "csv", "npy" and "npz".
std::vector<MapFormat> plain_points_formats();

}  // namespace cairn
