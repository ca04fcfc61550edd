// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "cairn/adjustment/adjust.hpp"
#include "cairn/merging/fusion/fuse_maps.hpp"

namespace cairn {

struct FuseAndAdjustOptions {
  FusionOptions fusion = {};  ///< its progress is not used
  AdjustOptions adjustment = {};
  /// Rounds of matching landmarks again after an adjustment, and adjusting again; 0 to 10.
  int matching_rounds = 2;

  /// @throws Error (misuse) naming the field, its value and the constraint
  void validate() const;
};

/// Result of adjusting a merged map; see AdjustResult.
struct MergeAdjustment {
  bool converged = false;
  int iterations = 0;  ///< of all rounds
  std::size_t observations = 0;
  double initial_rms_px = 0.0;  ///< with the landmarks of the first fusion
  double final_rms_px = 0.0;    ///< with the landmarks of the last fusion
  int matching_rounds = 0;
};

struct AdjustedFusion {
  LandmarkMap map;
  std::vector<MapFusion> maps;                  ///< one per map, of the last fusion
  std::vector<std::vector<FrameIndex>> frames;  ///< per map and frame: its index in `map`
  MergeAdjustment adjustment;
};

/// A map with the keyframe poses of an adjusted map that was made from it. Each landmark and its covariance
/// move with the keyframe that observed it first, or with the map if none did. Keeps the map's cameras.
/// @param world_from_map pose of the map before the adjustment; its scale is applied
/// @param frames         frame of `adjusted` for each frame of the map
LandmarkMap moved_with_frames(const LandmarkMap& map, const Similarity3& world_from_map,
                              const LandmarkMap& adjusted, std::span<const FrameIndex> frames);

/// Repeats fuse_maps() and adjust(): matches landmarks anew from their own maps' positions under the
/// adjusted poses (moved_with_frames()). Earlier matches are not kept, so a wrong match can disappear, and
/// landmarks that were too far apart can be matched.
///
/// Covariances are in the world: each group of frames that share landmarks is as uncertain as the pose of its
/// first frame and of that frame's map. The log says if the covariances are too large for the memory; the
/// result then has none.
///
/// @throws Error as fuse_maps() and adjust()
AdjustedFusion fuse_and_adjust(std::span<const PlacedMap> maps,
                               const FuseAndAdjustOptions& options = {});

}  // namespace cairn
