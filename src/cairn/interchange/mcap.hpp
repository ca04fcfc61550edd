// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "cairn/core/file.hpp"
#include "cairn/geometry/similarity3.hpp"
#include "cairn/map/io/format_registry.hpp"
#include "cairn/map/landmark_map.hpp"

namespace cairn {

/// Writes a map as an MCAP recording of Foxglove's messages (docs/formats.md), for Foxglove, Lichtblick and
/// rerun: landmarks, keyframes and the trajectory at the start, and the camera's pose at the time of each
/// keyframe. In a map without times, keyframe i of its order is at 0.1 i seconds.
/// @throws Error (input) naming a keyframe whose time MCAP does not hold, (misuse) for a named column whose
///         name is that of another field
void write_mcap(const LandmarkMap& map, const ByteSink& sink, const MapWriteOptions& options = {});

/// A map among several that are written in one frame.
struct McapMap {
  std::string name;  ///< unique
  Similarity3 world_from_map;
  std::function<LandmarkMap()> read;  ///< called once
};

/// A link between two maps, drawn as a line between the centres of their landmarks.
struct McapLink {
  std::size_t target = 0;  ///< index of a map
  std::size_t source = 0;
  std::string kind;                   ///< e.g. "placement"
  std::optional<double> probability;  ///< that the link is right; std::nullopt if nobody judged
  bool agrees = true;                 ///< false: it contradicts the poses of the maps
};

/// Writes maps, each in a frame of its own, "map/NAME", below the frame "world", and the links between them.
/// All of it is at time 0. A frame has no scale: a map's lengths are multiplied by that of its pose.
/// @throws Error as above, and what `McapMap::read` throws
void write_mcap(std::span<const McapMap> maps, std::span<const McapLink> links,
                const ByteSink& sink);

/// The format "mcap", which is only written.
std::vector<MapFormat> mcap_formats();

}  // namespace cairn
