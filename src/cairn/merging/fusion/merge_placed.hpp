// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "cairn/merging/fusion/fuse_and_adjust.hpp"

namespace cairn {

struct MergePlacedOptions {
  FusionOptions fusion = {};
  /// Whether the merged map is adjusted: all its keyframes and landmarks, by all observations.
  bool adjust = false;
  AdjustOptions adjustment = {};  ///< its execution is the fusion's
  /// How often landmarks are matched again after an adjustment; see FuseAndAdjustOptions.
  int matching_rounds = 2;

  /// @throws Error (misuse) naming the field, its value and what it may be
  void validate() const;
};

struct MergedPlaced {
  LandmarkMap map;
  std::vector<MapFusion> maps;  ///< one a map
  /// std::nullopt where it was not asked for, or the maps do not tell enough; the log says why.
  std::optional<MergeAdjustment> adjustment;
};

/// Makes one map of maps whose poses are known: fuse_maps(), or fuse_and_adjust() where that is asked for and
/// every map that knows observations of its landmarks can be adjusted.
/// @throws Error as fuse_maps() and fuse_and_adjust()
MergedPlaced merge_placed(std::span<const PlacedMap> maps, const MergePlacedOptions& options = {});

}  // namespace cairn
