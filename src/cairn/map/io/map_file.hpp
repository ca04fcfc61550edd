// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <optional>
#include <string_view>

#include "cairn/core/file.hpp"
#include "cairn/map/io/options.hpp"
#include "cairn/map/landmark_map.hpp"

namespace cairn {

/// The map formats Cairn reads and writes (docs/formats.md).
enum class MapFormat { kNative, kBinary, kPly, kPcd };

/// By the extension of a path (.map and .txt, .cairn, .ply, .pcd); nothing if unknown.
std::optional<MapFormat> format_of_extension(const std::filesystem::path& path);

/// Whether a format holds all of a map; if not, its landmarks only.
bool holds_whole_map(MapFormat format);

/// Reads a map in any format, recognised by the file's first bytes.
/// @throws Error (input) naming the file, line or byte, field, value and what was expected
LandmarkMap read_map(const std::filesystem::path& path, const MapReadOptions& options = {});

struct MapWriteOptions {
  std::optional<MapFormat> format = {};    ///< nothing: by the path's extension
  std::optional<int> native_version = {};  ///< nothing: 1 where it holds all of the map, else 2
  bool ascii = false;                      ///< PLY and PCD: text instead of binary
  bool double_precision =
      false;  ///< PCD: positions as doubles, which PCL's point types do not take
  Progress progress = {};
};

/// Writes a map in this format to a stream; `options.format` has no effect.
void write_map(const LandmarkMap& map, const ByteSink& sink, MapFormat format,
               const MapWriteOptions& options = {});

/// Writes a map, whole or not at all.
/// @throws Error (misuse) for an unknown extension, (storage) if the file cannot be written
void write_map(const LandmarkMap& map, const std::filesystem::path& path,
               const MapWriteOptions& options = {});

}  // namespace cairn
