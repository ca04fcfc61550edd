// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "cairn/alignment/alignment.hpp"
#include "cairn/map/landmark_map.hpp"
#include "cairn/merging/fusion/fuse_maps.hpp"
#include "cairn/merging/linking/link_maps.hpp"

namespace cairn {

struct StraightenedMap {
  LandmarkMap map;  ///< in the frame of the bent one
  MapBend bend;     ///< that it had
};

/// Straightens maps that others show to be bent: straightened(). Places the parts of each pair that is aligned as a
/// whole, too. A map is straightened by the first pair that shows it to be bent by 2° or more, if at least 2 % more
/// landmarks can then be fused with the other map of the pair.
///
/// If a link's scale is free, its source is first deformed as the target shows (DeformablePair), if it clearly is, by 2°
/// or 2 % of lengths, and if as many more landmarks can then be fused. The bend states the rotations.
///
/// @param links stated and aligned ones of the maps by index, in any order. The most certain ones that connect all maps
///        are used. Their poses stay those of the straightened maps
/// @return one per map; std::nullopt for a map that stays as it is
std::vector<std::optional<StraightenedMap>> straighten_maps(std::span<const PlacedMap> maps,
                                                            std::span<const MapLink> links,
                                                            const FusionOptions& options = {});

}  // namespace cairn
