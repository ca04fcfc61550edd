// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <span>

#include "cairn/merging/fusion/fuse_maps.hpp"

namespace cairn::detail {

/// Whether the maps are Gaussian splats, which are joined and not fused.
/// @throws Error (input) naming the map if some are and others are not, or if their columns cannot be joined
bool are_splats(std::span<const PlacedMap> maps);

/// Joins splats into one, in the world: see fuse_maps().
/// @param maps maps for which are_splats() is true
FusionResult join_splats(std::span<const PlacedMap> maps, const FusionOptions& options,
                         const Executor& executor = Executor());

}  // namespace cairn::detail
