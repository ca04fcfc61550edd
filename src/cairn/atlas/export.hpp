// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "cairn/atlas/atlas.hpp"
#include "cairn/core/file.hpp"
#include "cairn/trajectory/trajectory.hpp"

namespace cairn {

/// Keyframes of a component's maps that have a time, in its frame; of several at one time the first.
Trajectory keyframes_of(Atlas& atlas, const AtlasState& state, const AtlasComponent& component);

/// Name of the column of cloud_of() that says which map a landmark is of.
inline constexpr const char* kNodeColumn = "map";

/// Landmarks of a component's maps, in its frame, side by side: nothing is fused, and there are no frames.
LandmarkMap cloud_of(Atlas& atlas, const AtlasState& state, const AtlasComponent& component);

/// Writes a component as an MCAP recording (interchange/mcap.hpp): its maps, each in a frame of its own, and the
/// aligned links between them.
void write_mcap(Atlas& atlas, const AtlasState& state, const AtlasComponent& component,
                const ByteSink& sink);

}  // namespace cairn
