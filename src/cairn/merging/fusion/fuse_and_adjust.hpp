// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "cairn/adjustment/adjust.hpp"
#include "cairn/merging/fusion/fuse_maps.hpp"

namespace cairn {

/// A keyframe that two of the maps have: one image, hence one pose.
struct SharedFrame {
  std::size_t map = 0;
  FrameIndex frame;
  std::size_t other_map = 0;  ///< after `map`
  FrameIndex other_frame;
};

struct FuseAndAdjustOptions {
  FusionOptions fusion = {};  ///< its progress is not used
  AdjustOptions adjustment = {};
  /// How often landmarks are matched again after an adjustment, and adjusted again; 0 to 10.
  int matching_rounds = 2;
  /// Each keyframe of `other_map` is left out for that of `map`; a keyframe is named once at most.
  std::vector<SharedFrame> shared_frames = {};

  /// @throws Error (misuse) naming the field, its value and what it may be
  void validate() const;
};

/// What the adjustment of a merged map did; see AdjustResult.
struct MergeAdjustment {
  bool converged = false;
  int iterations = 0;  ///< of all rounds
  std::size_t observations = 0;
  double initial_rms_px = 0.0;  ///< of the landmarks as they were fused first
  double final_rms_px = 0.0;    ///< of those that were fused last
  int matching_rounds = 0;
};

struct AdjustedFusion {
  LandmarkMap map;
  std::vector<MapFusion> maps;                  ///< one a map, as they were fused last
  std::vector<std::vector<FrameIndex>> frames;  ///< by map and its frame: which of `map` it is
  MergeAdjustment adjustment;
};

/// A map whose keyframes lie in the world where another map, that was made from it and adjusted, has them.
/// Each landmark goes with the keyframe that observed it first, and so does its covariance; one that none
/// observed goes with the map. Cameras stay those of the map.
/// @param world_from_map where the map was before; its scale is applied
/// @param frames         of `adjusted`, one a frame of the map
LandmarkMap moved_with_frames(const LandmarkMap& map, const Similarity3& world_from_map,
                              const LandmarkMap& adjusted, std::span<const FrameIndex> frames);

/// fuse_maps(), adjust(), and again: landmarks are matched anew from where their own maps have them under
/// the adjusted poses (moved_with_frames()). What was matched before does not count, so that a wrong match
/// may go, and landmarks that were too far apart for one may meet.
///
/// @throws Error as fuse_maps() and adjust(); (misuse) for a shared frame that there is not
AdjustedFusion fuse_and_adjust(std::span<const PlacedMap> maps,
                               const FuseAndAdjustOptions& options = {});

}  // namespace cairn
