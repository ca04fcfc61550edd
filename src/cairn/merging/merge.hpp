// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "cairn/merging/fusion/merge_placed.hpp"
#include "cairn/merging/linking/link_maps.hpp"
#include "cairn/pose_graph/optimise_poses.hpp"

namespace cairn {

/// A map to merge.
struct MergeInput {
  std::string name;
  const LandmarkMap* map = nullptr;  ///< not null
  std::string session = {};          ///< name that maps of one run share; empty if unknown
  /// Map in the same frame and unit that is aligned in place of `map`, such as the SfM model that a
  /// splat map was trained on. Null: `map` itself.
  const LandmarkMap* model = nullptr;
  LandmarkMap* disposable = nullptr;  ///< see PlacedMap
};

/// Options of merge(): options of fusion and linking.
struct MergeOptions : FusionOptions {
  LinkOptions links = {};
  /// Known links, e.g. odometry between mini-maps of one run. Their nodes are map indices.
  std::vector<Link> stated = {};

  /// @throws Error (misuse) naming the field, its value and the constraint
  void validate() const;
};

/// Result for one map.
struct MergedMap {
  bool placed = false;
  std::string reason;  ///< why the map is not placed, in one sentence; empty if placed
  /// Index in MergeResult::links of the likeliest link of an unplaced map without an aligned link.
  std::optional<std::size_t> likeliest_link;
  std::optional<Similarity3> world_from_map;
  Matrix7d covariance = Matrix7d::Zero();  ///< see OptimisedPoses
  /// Part left out of the map, if another map shows it to be folded; `other` is an index of the
  /// inputs.
  std::optional<MapFold> fold;
  /// Bend of the map, if the map was straightened before the fusion.
  std::optional<MapBend> bend;
  std::optional<MapFusion> fusion;
};

struct MergeResult {
  std::vector<MergedMap> maps;  ///< one per input
  /// Links of all tried pairs, aligned or not; then the stated links. Their nodes are map indices.
  std::vector<Link> links;
  std::vector<bool> used;         ///< per link: whether it is aligned and agrees with the poses
  std::vector<std::size_t> tree;  ///< indices of links that first placed a map, in order
  /// Merged map, in the frame of the first placed map; std::nullopt if no two maps were placed.
  std::optional<LandmarkMap> map;
  /// Adjustment of `map`; std::nullopt if not requested, or if the maps lack the data; the log says
  /// why. The poses above precede the adjustment, which moves keyframes individually.
  std::optional<MergeAdjustment> adjustment;

  std::size_t placed() const;
};

/// The links that connect maps as a graph; its nodes are the maps by index.
PoseGraph pose_graph(std::span<const MergeInput> maps, const MergeResult& result);

/// Merges maps of one place: place_maps(), then fuse_placed().
/// @throws Error (misuse) for fewer than two maps or invalid options, (cancelled)
MergeResult merge(std::span<const MergeInput> maps, const MergeOptions& options = {},
                  const Execution& execution = {});

/// The first half of merge(): link_maps(), then optimise_poses(). Only aligned and stated links
/// place a map; maps without a link to the largest group are left out. The order of the maps
/// affects only the frame, the numbering, and decisions that depend on rounding in that frame.
/// @return result without a merged map
/// @throws Error as merge(), (misuse) for a map that is given twice under any names, (input) for a
///         model that lies elsewhere than its map
MergeResult place_maps(std::span<const MergeInput> maps, const MergeOptions& options = {},
                       const Execution& execution = {});

/// The second half of merge(): merge_placed() of the placed maps, if any, with the used links
/// between them.
/// @param result output of place_maps(), or restored from an atlas; receives the merged map
/// @return per map and frame that is not left out as folded: index in the merged map; empty for a
///        map that is not placed
/// @throws Error as merge_placed()
std::vector<std::vector<FrameIndex>> fuse_placed(std::span<const MergeInput> maps,
                                                 const FusionOptions& options, MergeResult& result,
                                                 const Execution& execution = {});

}  // namespace cairn
