// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "cairn/adjustment/adjust.hpp"
#include "cairn/alignment/alignment.hpp"
#include "cairn/merging/fusion/fuse_maps.hpp"
#include "cairn/pose_graph/pose_graph.hpp"

namespace cairn {

/// Result of adjusting a merged map; see AdjustResult.
struct MergeAdjustment {
  bool converged = false;
  int iterations = 0;  ///< of all rounds
  std::size_t observations = 0;
  double initial_rms_px = 0.0;  ///< with the landmarks of the first fusion
  double final_rms_px = 0.0;    ///< with the landmarks of the last fusion
  int matching_rounds = 0;
};

struct MergedPlaced {
  LandmarkMap map;
  std::vector<MapFusion> maps;                ///< one per map
  std::vector<std::optional<MapFold>> folds;  ///< per map: what is left out of it
  /// Per map and frame that is not left out: its index in `map`.
  std::vector<std::vector<FrameIndex>> frames;
  /// Per map: how far it was bent, if it was straightened before the fusion.
  std::vector<std::optional<MapBend>> bends;
  /// std::nullopt if not requested, or if the maps lack the data; the log says why.
  std::optional<MergeAdjustment> adjustment;
};

/// Merges maps with known poses: leaves out what is folded, straightens them, then fuses them (fuse_maps()). If adjustment is requested and every
/// map with observations can be adjusted, repeats fuse_maps() and adjust(): each round matches landmarks anew from their
/// own maps' positions under the adjusted poses. Earlier matches are not kept, so a wrong match can disappear, and
/// landmarks that were too far apart can be matched.
///
/// The log names the frames that are left out because another map shows them to be folded (find_folds()).
///
/// A map is straightened by the first pair that shows it to be bent by 2° or more, if at least 2 % more landmarks can
/// then be fused with the other map of the pair. If a link's scale is free, its source is first deformed as the target
/// shows (DeformablePair), if it clearly is, by 2° or 2 % of lengths, and if as many more landmarks can then be fused.
///
/// Covariances of an adjusted map are in the world: each group of frames that share landmarks is as uncertain as the pose
/// of its first frame and of that frame's map. The log says if the covariances are too large for the memory; the result
/// then has none.
///
/// @param links stated and aligned ones of the maps by index, in any order; without any, no map is straightened. The most
///        certain ones that connect all maps are used. Their poses stay those of the straightened maps
/// @throws Error as fuse_maps() and adjust()
MergedPlaced merge_placed(std::span<const PlacedMap> maps, std::span<const Link> links,
                          const FusionOptions& options = {}, const Execution& execution = {});

}  // namespace cairn
