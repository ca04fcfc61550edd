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
  int iterations = 0;  ///< total of all rounds
  std::size_t observations = 0;
  double initial_rms_px = 0.0;  ///< with the landmarks of the first fusion
  double final_rms_px = 0.0;    ///< with the landmarks of the last fusion
  int matching_rounds = 0;
};

struct MergedPlaced {
  LandmarkMap map;
  std::vector<MapFusion> maps;                ///< one per map
  std::vector<std::optional<MapFold>> folds;  ///< per map: the part left out as folded
  /// Per map and frame that is not left out: its index in `map`.
  std::vector<std::vector<FrameIndex>> frames;
  /// Per map: its bend, if the map was straightened before the fusion.
  std::vector<std::optional<MapBend>> bends;
  /// std::nullopt if not requested, or if the maps lack the data; the log says why.
  std::optional<MergeAdjustment> adjustment;
};

/// Merges maps with known poses: leaves out folded parts, straightens bent maps, then fuses all
/// maps (fuse_maps()). If adjustment is requested and every map with observations can be adjusted,
/// repeats fuse_maps() and adjust(). Each round matches landmarks again, from the positions in
/// their own maps under the adjusted poses. Earlier matches are discarded, so a wrong match can
/// disappear, and landmarks that were too far apart can match.
///
/// The log names the frames that are left out because another map shows them to be folded (find_folds()).
///
/// A map is straightened by the first pair that shows a bend of 2° or more, if at least 2 % more
/// landmarks can then be fused with the other map of the pair. If a link's scale is free, a
/// deformation of the source is corrected first (DeformablePair). The deformation must be clear,
/// reach 2° or 2 % of lengths, and its correction must allow at least 2 % more fused landmarks.
///
/// Covariances of an adjusted map are in the world: each group of frames that share landmarks has
/// the uncertainty of its first frame's pose and of the pose of that frame's map. If the
/// covariances do not fit into memory, the result has none, and the log reports this.
///
/// @param links stated and aligned links of the maps by index, in any order; without links, no map
///        is straightened. The most certain links that connect all maps are used. Their poses
///        remain valid for the straightened maps
/// @throws Error as fuse_maps() and adjust()
MergedPlaced merge_placed(std::span<const PlacedMap> maps, std::span<const Link> links,
                          const FusionOptions& options = {}, const Execution& execution = {});

}  // namespace cairn
