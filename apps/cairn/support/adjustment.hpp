// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <string>

#include "cairn/merging/merge.hpp"

#include "support/documents.hpp"

namespace cairn::cli {

/// Adds --straighten, --thin-splats, --adjust, their negations and --refine-intrinsics to a command that writes a
/// merged map.
void add_adjustment_to(const Command& command, FusionOptions& options);

/// The bend in documents; null if the map was not straightened.
Json bend_json(const std::optional<MapBend>& bend);

/// "; NAME was bent by 2.1 deg, mended"; empty if the map was not straightened.
std::string bend_text(const std::optional<MapBend>& bend, const std::string& name);

/// Adds the pose of a placed map and how it was fused to its document.
void add_placement(const MergedMap& map, Json& json);

/// The adjustment in documents; null if the map was not adjusted.
Json adjustment_json(const std::optional<MergeAdjustment>& adjustment);

/// The adjustment in one line; empty if the map was not adjusted.
std::string adjustment_text(const std::optional<MergeAdjustment>& adjustment);

}  // namespace cairn::cli
