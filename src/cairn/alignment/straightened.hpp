// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "cairn/alignment/map_bend.hpp"
#include "cairn/placement/place.hpp"
#include "cairn/placement/prepared_map.hpp"

namespace cairn {

/// Whether two maps, of which the one that bends is straightened, are aligned as whole maps are.
///
/// Each landmark is moved by the pose between those that the consensus gives the two parts about it, and
/// back by the one pose of all. The straightened map is then refined from that one pose and judged as
/// place() judges any map, by descriptors alone, as strictly as where those decide without a search: at
/// least 15 matches must agree outside their largest cluster. A thing that stands in two places is found by
/// several parts that see it, and is still one small thing of the whole.
///
/// @param parts   with a consensus
/// @param options of the placement; `search` and `trace` have no effect
bool is_aligned_straightened(const PartsAlignment& parts, const PreparedMap& source,
                             const PreparedMap& target, const PlaceOptions& options);

}  // namespace cairn
