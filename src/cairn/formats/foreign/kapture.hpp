// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "cairn/core/file.hpp"
#include "cairn/formats/format_registry.hpp"
#include "cairn/formats/options.hpp"
#include "cairn/map/landmark_map.hpp"

namespace cairn {

/// The files of a kapture folder, by their paths below it, e.g. "sensors/sensors.txt".
struct KaptureFiles {
  std::string name;  ///< of the folder, for messages
  /// A file; null where there is none.
  std::function<std::unique_ptr<ByteSource>(const std::string& path)> open;
  /// Names of what a folder below holds, sorted; empty where there is no such folder.
  std::function<std::vector<std::string>(const std::string& path)> list;
};

/// Reads a kapture folder of version 1.0 or 1.1 (docs/formats.md): images with a pose become frames, 3D points
/// landmarks of free scale.
/// @throws Error (input) naming file, line, field, what was found and what was expected
LandmarkMap read_kapture(const KaptureFiles& files, const MapReadOptions& options = {});
LandmarkMap read_kapture(const std::filesystem::path& folder, const MapReadOptions& options = {});

/// The format "kapture".
std::vector<MapFormat> kapture_formats();

}  // namespace cairn
