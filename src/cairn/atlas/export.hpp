// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <optional>

#include "cairn/atlas/atlas.hpp"
#include "cairn/core/file.hpp"
#include "cairn/core/log.hpp"
#include "cairn/geometry/trajectory.hpp"

namespace cairn {

/// Timed keyframes of a component's maps, in its frame; the first of several at one time.
Trajectory keyframes_of(Atlas& atlas, const AtlasState& state, const AtlasComponent& component);

/// Column of cloud_of() with the id of a landmark's map.
inline constexpr const char* kNodeColumn = "map";

/// Landmarks of a component's maps, in its frame, without fusion and without frames.
LandmarkMap cloud_of(Atlas& atlas, const AtlasState& state, const AtlasComponent& component);

/// Writes a component as an MCAP recording (interchange/mcap.hpp): its maps, each in its own frame, and
/// their aligned links.
void write_mcap(Atlas& atlas, const AtlasState& state, const AtlasComponent& component,
                const ByteSink& sink);

/// What export_atlas() writes.
enum class AtlasExport {
  kG2o,         ///< ".g2o": pose_graph(), without links whose covariance has seven numbers
  kGraph,       ///< ".json": pose_graph()
  kTrajectory,  ///< ".tum": keyframes_of()
  kCloud,       ///< ".ply": cloud_of()
  kRecording,   ///< ".mcap": write_mcap()
  kFolder,      ///< a folder, or no ending: every map as .cairn, and graph.json
};

/// @throws Error (misuse) for another ending
AtlasExport export_of(const std::filesystem::path& path);

/// Writes what export_of() says; a file whole or not at all.
/// @param frame of a trajectory, cloud or recording: a map of the component; std::nullopt: the largest
/// @param log   told what is left out
/// @throws Error (misuse) as export_of() and component_with(), or before anything is written if that would replace
///         the atlas, (input) if a trajectory would be empty, (storage) if it cannot be written
void export_atlas(Atlas& atlas, const AtlasState& state, const std::filesystem::path& path,
                  std::optional<NodeId> frame = {}, const LogSink& log = {});

}  // namespace cairn
