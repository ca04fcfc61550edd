// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>

#include "cairn/atlas/atlas.hpp"

namespace cairn {

/// The largest group of placed maps of an atlas as one map, for reading: Atlas::merge(), or the map of an atlas of one.
///
/// Beside an atlas in a file that this user may change, the merged map is kept in merged_world_file(). It holds a hash
/// of the maps, links and poses that it was made of, of the seed and of Cairn's version, and is used only while these
/// are the atlas's. AtlasStore::compact() removes it.
LandmarkMap merged_world(Atlas& atlas, const AtlasState& state, std::uint64_t seed,
                         const Execution& execution = {});

}  // namespace cairn
