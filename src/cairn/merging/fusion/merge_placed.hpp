// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "cairn/merging/fusion/fuse_and_adjust.hpp"

namespace cairn {

struct MergePlacedOptions {
  FusionOptions fusion = {};
  /// Whether to bundle-adjust all keyframes and landmarks of the merged map.
  bool adjust = false;
  AdjustOptions adjustment = {};  ///< its execution is the fusion's
  /// Rounds of matching again after an adjustment; see FuseAndAdjustOptions.
  int matching_rounds = 2;

  /// @throws Error (misuse) naming the field, its value and the constraint
  void validate() const;
};

struct MergedPlaced {
  LandmarkMap map;
  std::vector<MapFusion> maps;  ///< one per map
  /// std::nullopt if not requested, or if the maps lack the data; the log says why.
  std::optional<MergeAdjustment> adjustment;
};

/// Merges maps with known poses: fuse_maps(), or fuse_and_adjust() if requested and every map with
/// observations can be adjusted.
/// @throws Error as fuse_maps() and fuse_and_adjust()
MergedPlaced merge_placed(std::span<const PlacedMap> maps, const MergePlacedOptions& options = {});

}  // namespace cairn
