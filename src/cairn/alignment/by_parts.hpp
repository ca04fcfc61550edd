// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "cairn/alignment/map_bend.hpp"
#include "cairn/placement/place.hpp"
#include "cairn/placement/prepared_map.hpp"

namespace cairn {

/// Places each part of one map on the whole other map, by descriptors alone, and sees whether the poses
/// agree up to a bend of the map.
///
/// A part is aligned by itself if place() says so and at least 15 descriptor matches agree with the pose
/// outside their largest cluster. There is a consensus if at least two parts of one map are, with
/// landmarks of at least two parts of the other (a fifth of their matches each), and if
/// every two of them in a row differ by at most 8 degrees and a displacement of 0.15 times the map's
/// radius, all of them by at most 20 degrees. It is withdrawn if a part of the other map is aligned by
/// itself with a pose that is that far from all of theirs.
///
/// @param options of each placement; `search` and `trace` have no effect
/// @return nothing placed if not both maps can be cut or the maps have no descriptors
PartsAlignment place_by_parts(const PreparedMap& source, const PreparedMap& target,
                              const PlaceOptions& options);

}  // namespace cairn
