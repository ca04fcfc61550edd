// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <span>

#include "cairn/merging/fusion/merge_placed.hpp"

namespace cairn::detail {

/// A map with the keyframe poses and camera parameters of an adjusted map that was made from it. Each landmark is where
/// its lines of sight now meet. If depths were measured, or the lines are nearly parallel, it moves with the keyframe that
/// observed it first instead, or with the map if none did. Covariances turn with that keyframe.
/// @param world_from_map pose of the map before the adjustment; its scale is applied
/// @param frames         frame of `adjusted` for each frame of the map
LandmarkMap moved_with_frames(const LandmarkMap& map, const Similarity3& world_from_map,
                              const LandmarkMap& adjusted, std::span<const FrameIndex> frames);

/// The rounds of fusing and adjusting of merge_placed(), which uses its progress for the adjustment.
MergedPlaced fuse_and_adjust(std::span<const PlacedMap> maps, const FusionOptions& options,
                             const Execution& execution = {});

}  // namespace cairn::detail
