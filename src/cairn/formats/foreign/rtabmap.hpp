// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <vector>

#include "cairn/formats/format_registry.hpp"
#include "cairn/formats/options.hpp"
#include "cairn/map/landmark_map.hpp"
#include "cairn/pose_graph/pose_graph.hpp"

namespace cairn {

/// Reads a database of RTAB-Map (docs/formats.md): nodes become frames, in metres. RTAB-Map has no
/// landmarks; features of one visual word in linked nodes become a landmark if their geometry agrees.
/// @throws Error (input) naming file, table, row, value and constraint
LandmarkMap read_rtabmap(const std::filesystem::path& path, const MapReadOptions& options = {});

/// The nodes and links of such a database.
PoseGraph read_rtabmap_graph(const std::filesystem::path& path, const MapReadOptions& options = {});

/// The format "rtabmap".
std::vector<MapFormat> rtabmap_formats();

}  // namespace cairn
