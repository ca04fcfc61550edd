// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <span>
#include <string>

#include "cairn/core/file.hpp"
#include "cairn/formats/map_file.hpp"
#include "cairn/geometry/similarity3.hpp"
#include "cairn/map/landmark_map.hpp"

namespace cairn {

/// Writes a map as an MCAP recording of Foxglove's messages (docs/formats.md), for Foxglove, Lichtblick and
/// rerun: landmarks, keyframes and the trajectory at the start, and the camera's pose at the time of each
/// keyframe. Without times, keyframe i is at 0.1 i seconds.
/// @throws Error (input) naming a keyframe whose time MCAP cannot represent, (misuse) for a named column
///        with the name of another field
void write_mcap(const LandmarkMap& map, const ByteSink& sink, const Execution& execution = {});

/// One of several maps to write in one world frame.
struct McapMap {
  std::string name;  ///< unique
  Similarity3 world_from_map;
  std::function<LandmarkMap()> read;  ///< called once
};

/// A link between two maps, drawn as a line between their landmarks' centres.
struct McapLink {
  std::size_t target = 0;  ///< index of a map
  std::size_t source = 0;
  std::string kind;                   ///< e.g. "placement"
  std::optional<double> probability;  ///< P(correct link); std::nullopt if not judged
  bool agrees = true;                 ///< false: it contradicts the maps' poses
};

/// Writes maps, each in its own frame "map/NAME" below the frame "world", and the links between them, all
/// at time 0. Frames have no scale, so a map's lengths are multiplied by the scale of its pose.
/// @throws Error as above; rethrows exceptions of `McapMap::read`
void write_mcap(std::span<const McapMap> maps, std::span<const McapLink> links,
                const ByteSink& sink);

}  // namespace cairn
