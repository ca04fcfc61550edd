// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "cairn/alignment/alignment.hpp"
#include "cairn/merging/fusion/fuse_and_adjust.hpp"
#include "cairn/merging/linking/link_maps.hpp"

namespace cairn {

struct MergePlacedOptions {
  FusionOptions fusion = {};
  /// Whether to straighten maps that others show to be bent: straighten_maps().
  bool straighten = true;
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
  /// Per map: how far it was bent, if it was straightened before the fusion.
  std::vector<std::optional<MapBend>> bends;
  /// std::nullopt if not requested, or if the maps lack the data; the log says why.
  std::optional<MergeAdjustment> adjustment;
};

/// Merges maps with known poses: straighten_maps(), then fuse_maps(), or fuse_and_adjust() if requested and every map with
/// observations can be adjusted.
/// @param links as for straighten_maps(); without any, no map is straightened
/// @throws Error as fuse_maps() and fuse_and_adjust()
MergedPlaced merge_placed(std::span<const PlacedMap> maps, std::span<const MapLink> links,
                          const MergePlacedOptions& options = {});

}  // namespace cairn
