// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "cairn/core/file.hpp"
#include "cairn/formats/format_registry.hpp"
#include "cairn/formats/options.hpp"
#include "cairn/map/landmark_map.hpp"

namespace cairn {

/// Reads text points, one per line, with numbers separated by blanks, commas or semicolons. A first line or a comment with
/// names identifies the columns, which are read like PLY's properties (docs/formats.md). Without names, three columns are x,
/// y and z, and of more columns the first three are if the numbers or the file's name say so. Reads a pipe into memory.
/// @throws Error (input) naming source, line, field, value and constraint, or what the text holds instead of points
LandmarkMap read_plain_points(ByteSource& source, const MapReadOptions& options = {});

/// Reads a NumPy array, version 1 to 3 of the .npy format: N x 3 float32 or float64, row-major.
/// @throws Error (input) naming source, byte, value and constraint
LandmarkMap read_npy_points(ByteSource& source, const MapReadOptions& options = {});

/// Reads an archive of arrays from numpy.savez or savez_compressed: positions, and arrays with one entry
/// per point.
/// @throws Error (input) naming source, array, value and constraint
LandmarkMap read_npz_points(ByteSource& source, const MapReadOptions& options = {});

/// Writes positions only, one point per line.
void write_xyz_points(const LandmarkMap& map, const ByteSink& sink,
                      const MapWriteOptions& options = {});
/// Writes a line of names, then a line per landmark, comma-separated, with the same fields as PLY.
/// @throws Error (misuse) for a named column whose name has another meaning
void write_csv_points(const LandmarkMap& map, const ByteSink& sink,
                      const MapWriteOptions& options = {});
/// Writes positions as N x 3 float64.
void write_npy_points(const LandmarkMap& map, const ByteSink& sink,
                      const MapWriteOptions& options = {});
/// Writes positions, ids, covariances, colours, descriptors, named columns and observation counts.
void write_npz_points(const LandmarkMap& map, const ByteSink& sink,
                      const MapWriteOptions& options = {});

/// The formats "xyz", "csv", "npy" and "npz".
std::vector<MapFormat> plain_points_formats();

}  // namespace cairn
