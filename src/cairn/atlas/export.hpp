// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "cairn/atlas/atlas.hpp"
#include "cairn/core/file.hpp"
#include "cairn/trajectory/trajectory.hpp"

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

}  // namespace cairn
