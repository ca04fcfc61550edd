// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "cairn/atlas/atlas.hpp"
#include "cairn/merging/changes.hpp"

namespace cairn {

/// Maps of a session that have a pose.
std::vector<NodeId> placed_of_session(const AtlasState& state, const std::string& session);

/// find_changes() between two sets of maps of an atlas, each fused first. The result is in the frame of
/// their group; its landmarks are those of the fused maps.
/// @throws Error (misuse) if a set is empty, a map is in both, or one has no pose in the common frame
ChangeResult world_difference(Atlas& atlas, const AtlasState& state,
                              const std::vector<NodeId>& first, const std::vector<NodeId>& second,
                              const ChangeOptions& options = {});

}  // namespace cairn
