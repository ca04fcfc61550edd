// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "cairn/merging/fusion/merge_placed.hpp"
#include "cairn/merging/linking/link_maps.hpp"
#include "cairn/pose_graph/pose_graph.hpp"

namespace cairn {

/// A map to merge.
struct MergeInput {
  std::string name;
  const LandmarkMap* map = nullptr;  ///< not null
};

struct MergeOptions {
  LinkOptions links = {};  ///< its execution and seed are taken from below
  /// Links that are known besides, of maps by index, such as odometry's between mini-maps of one run.
  std::vector<PoseLink> stated = {};
  MergePlacedOptions placed = {};  ///< its fusion's seed, execution and log are taken from below
  std::uint64_t seed = 0;
  Execution execution = {};
  LogSink log = {};

  /// @throws Error (misuse) naming the field, its value and what it may be
  void validate() const;
};

/// What became of one map.
struct MergedMap {
  bool placed = false;
  std::string reason;  ///< why it is not placed, in one sentence; empty if it is placed
  /// Index in MergeResult::links of the likeliest link of a map that is not placed, if none is aligned.
  std::optional<std::size_t> likeliest_link;
  std::optional<Similarity3> world_from_map;
  Matrix7d covariance = Matrix7d::Zero();  ///< see OptimisedPoses
  std::optional<MapFusion> fusion;
};

struct MergeResult {
  std::vector<MergedMap> maps;    ///< one an input
  std::vector<MapLink> links;     ///< of all pairs, aligned or not; then those that were stated
  std::vector<bool> used;         ///< by link: aligned, and in agreement with the poses
  std::vector<std::size_t> tree;  ///< links that first placed a map, in that order
  /// In the frame of the first map that is placed. std::nullopt where no two maps were placed.
  std::optional<LandmarkMap> map;
  /// std::nullopt where it was not asked for, or the maps do not tell enough; the log says why. Poses of maps
  /// above are those before it: their keyframes no longer move as one.
  std::optional<MergeAdjustment> adjustment;

  std::size_t placed() const;
};

/// The aligned links as a graph, whose nodes are the maps by index.
PoseGraph pose_graph(std::span<const MergeInput> maps, const MergeResult& result);

/// Merges maps of one place into one: link_maps(), optimise_poses(), merge_placed(). Only links that were
/// judged aligned, or stated, place a map; maps that nothing connects to the largest group stay out.
/// @throws Error (misuse) for fewer than two maps or invalid options, (cancelled)
MergeResult merge(std::span<const MergeInput> maps, const MergeOptions& options = {});

}  // namespace cairn
