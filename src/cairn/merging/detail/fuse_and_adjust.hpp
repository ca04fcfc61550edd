// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <span>

#include "cairn/merging/fusion/merge_placed.hpp"

namespace cairn::detail {

/// The map with the keyframe poses and camera parameters of an adjusted map that was made from it. Each landmark moves
/// to where its lines of sight meet after the adjustment. If its depths were measured, or its lines of sight are nearly
/// parallel, the landmark moves with the keyframe that observed it first, or with the map if no keyframe did. Its
/// covariance rotates with that keyframe.
/// @param world_from_map pose of the map before the adjustment; its scale is applied
/// @param frames         frame of `adjusted` for each frame of the map
/// @param cameras        camera of `adjusted` for each camera of the map; one without stays as it is
LandmarkMap moved_with_frames(const LandmarkMap& map, const Similarity3& world_from_map,
                              const LandmarkMap& adjusted, std::span<const FrameIndex> frames,
                              std::span<const std::optional<CameraIndex>> cameras);

/// The rounds of fusion and adjustment in merge_placed(). Only the adjustments report progress.
MergedPlaced fuse_and_adjust(std::span<const PlacedMap> maps, const FusionOptions& options,
                             const Execution& execution = {});

}  // namespace cairn::detail
