// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <optional>

#include "cairn/atlas/atlas.hpp"
#include "cairn/core/file.hpp"
#include "cairn/core/log.hpp"
#include "cairn/geometry/trajectory.hpp"

namespace cairn {

/// Keyframe poses of a component's maps by timestamp, in the component's frame. Of keyframes with
/// equal timestamps, only the first is kept.
Trajectory keyframes_of(Atlas& atlas, const AtlasState& state, const AtlasComponent& component);

/// Column of cloud_of() with the map id of each landmark.
inline constexpr const char* kNodeColumn = "map";

/// Landmarks of a component's maps, in the component's frame, without fusion and without keyframes.
LandmarkMap cloud_of(Atlas& atlas, const AtlasState& state, const AtlasComponent& component);

/// Writes a component as an MCAP recording (formats/foreign/mcap.hpp): its maps, each in its own
/// frame, and their aligned links.
void write_mcap(Atlas& atlas, const AtlasState& state, const AtlasComponent& component,
                const ByteSink& sink);

/// What export_atlas() writes.
enum class AtlasExport {
  kG2o,         ///< ".g2o": pose_graph(), only links with a 6 x 6 covariance
  kGraph,       ///< ".json": pose_graph()
  kTrajectory,  ///< ".tum": keyframes_of()
  kCloud,       ///< ".ply": cloud_of()
  kRecording,   ///< ".mcap": write_mcap()
  kFolder,      ///< a folder, or no ending: every map as .cairn, and graph.json
};

/// @throws Error (misuse) for another ending
AtlasExport export_of(const std::filesystem::path& path);

/// Writes the export that export_of() selects; each file is written atomically.
/// @param frame for a trajectory, cloud or recording: a map of the component; std::nullopt: the
///        largest one
/// @param log   receives the maps and links that are left out
/// @throws Error (misuse) as export_of() and component_with(), and if the export would overwrite
///         the atlas, (input) if a trajectory would be empty, (storage) if writing fails
void export_atlas(Atlas& atlas, const AtlasState& state, const std::filesystem::path& path,
                  std::optional<NodeId> frame = {}, const LogSink& log = {});

}  // namespace cairn
