// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <string_view>

#include "cairn/core/file.hpp"
#include "cairn/formats/map_file.hpp"
#include "cairn/map/landmark_map.hpp"

namespace cairn {

/// Reads Cairn's text format, version 1, 2 or 3 (docs/formats.md).
/// @throws Error (input) naming source, line, field, value and constraint
LandmarkMap read_native(ByteSource& source, const MapReadOptions& options = {});

/// What version 1 of the text format cannot hold of `map`, in words; std::nullopt if it can hold all.
std::optional<std::string> version_1_loss(const LandmarkMap& map);

/// Writes Cairn's text format.
/// @param version 1, 2 or 3; std::nullopt: the lowest that can hold the whole map
/// @throws Error (misuse) if the requested version cannot hold the map
void write_native(const LandmarkMap& map, const ByteSink& sink,
                  std::optional<int> version = std::nullopt, const Progress& progress = {});

/// First bytes of Cairn's binary format. No text begins with them, and a transfer that converts line ends
/// breaks them.
inline constexpr std::string_view kBinaryMagic =
    "\x89"
    "CAIRN\r\n";

/// Reads Cairn's binary format (docs/formats.md), memory-mapped if the source can be.
/// @throws Error (input) naming source, byte, field, value and constraint
LandmarkMap read_binary(ByteSource& source, const MapReadOptions& options = {});

/// Writes Cairn's binary format.
/// @throws Error (misuse) if a text of the map has 2^32 bytes or more
void write_binary(const LandmarkMap& map, const ByteSink& sink, const Progress& progress = {});

/// Reads the vertices of a PLY 1.0 file as landmarks (docs/formats.md lists the properties).
/// @throws Error (input) naming source, line or byte, value and constraint
LandmarkMap read_ply(ByteSource& source, const MapReadOptions& options = {});

/// Writes the landmarks as PLY 1.0 vertices: position, covariance, colour, count, named columns.
void write_ply(const LandmarkMap& map, const ByteSink& sink, const MapWriteOptions& options = {});

/// Reads the points of a PCD 0.7 file as landmarks (docs/formats.md lists the fields).
/// @throws Error (input) naming source, line or byte, value and constraint
LandmarkMap read_pcd(ByteSource& source, const MapReadOptions& options = {});

/// Writes the landmarks as PCD 0.7 points: position, covariance, colour, count, named columns.
void write_pcd(const LandmarkMap& map, const ByteSink& sink, const MapWriteOptions& options = {});

}  // namespace cairn
