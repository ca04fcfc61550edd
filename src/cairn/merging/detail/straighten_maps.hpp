// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "cairn/alignment/alignment.hpp"
#include "cairn/map/landmark_map.hpp"
#include "cairn/merging/fusion/fuse_maps.hpp"
#include "cairn/pose_graph/pose_graph.hpp"

namespace cairn::detail {

struct StraightenedMap {
  LandmarkMap map;  ///< in the frame of the bent map
  MapBend bend;     ///< bend before the straightening
};

/// The straightening in merge_placed().
/// @return one per map; std::nullopt for a map that stays as it is
std::vector<std::optional<StraightenedMap>> straighten_maps(std::span<const PlacedMap> maps,
                                                            std::span<const Link> links,
                                                            const FusionOptions& options = {},
                                                            const Execution& execution = {});

}  // namespace cairn::detail
