// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "cairn/alignment/bends/map_bend.hpp"
#include "cairn/alignment/prepared_map.hpp"
#include "cairn/alignment/search/place.hpp"

namespace cairn {

/// A bent map, straightened as the other map shows its parts. `parts.target_from_source` stays its pose, so the
/// frame is the map's own.
///
/// Each keyframe moves by the interpolated poses of the two parts around it (along_parts()). A landmark moves with the
/// middle one of the keyframes that observed it, or as the middle of the map if none did. Covariances turn with the
/// landmarks; the uncertainty of the parts' poses is not added.
///
/// @param map   the one that `parts.bend->map` names
/// @param parts with a consensus
LandmarkMap straightened(const LandmarkMap& map, const PartsAlignment& parts);

/// Whether two maps are aligned as a whole after the bent one is straightened.
///
/// Moves landmarks and keyframes as straightened() does. Refines the straightened map from the single pose and judges it
/// as place() does, by descriptors alone: at least 15 matches must agree outside their largest cluster. An object that stands in two places is
/// found by several parts that see it, but stays a small part of the whole map.
///
/// @param parts   with a consensus
/// @param options of the placement; `search` and `trace` have no effect
bool is_aligned_straightened(const PartsAlignment& parts, const PreparedMap& source,
                             const PreparedMap& target, const PlaceOptions& options);

}  // namespace cairn
