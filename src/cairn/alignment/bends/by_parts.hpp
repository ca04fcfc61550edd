// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "cairn/alignment/bends/map_bend.hpp"
#include "cairn/alignment/prepared_map.hpp"
#include "cairn/alignment/search/place.hpp"

namespace cairn {

/// Places each part of one map in the whole other map, by descriptors alone, and tests whether the poses
/// agree up to a bend of the map.
///
/// A part is aligned separately if place() aligns it and at least 15 descriptor matches outside their
/// largest cluster agree with the pose. There is a consensus if at least two parts of one map are aligned,
/// with landmarks of at least two parts of the other (a fifth of their matches each), consecutive parts
/// differ by at most 8 degrees and 0.15 times the map's radius, and any two by at most 20 degrees. An
/// aligned part of the other map that differs from all of them by more than that revokes the consensus.
///
/// @param options of each placement; `search` and `trace` have no effect
/// @return no parts if either map cannot be cut or has no descriptors
PartsAlignment place_by_parts(const PreparedMap& source, const PreparedMap& target,
                              const PlaceOptions& options);

}  // namespace cairn
