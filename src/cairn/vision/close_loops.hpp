// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "cairn/merging/merge.hpp"
#include "cairn/vision/map_sequence.hpp"

namespace cairn {

struct ClosedLoops {
  std::vector<Link> links;  ///< of the pairs of mini-maps that were tried
  std::vector<bool> used;   ///< per link: whether it is aligned and agrees with the poses
  /// Number of used links between mini-maps that are not consecutive.
  std::size_t closed = 0;
  /// Odometry links that contradict the closed loops.
  std::size_t odometry_refuted = 0;
  /// In the frame of the first mini-map. std::nullopt if no loop closed; the following members are then
  /// empty too.
  std::optional<LandmarkMap> map;
  Trajectory trajectory;  ///< of all frames, corrected
  MergeAdjustment adjustment;
  double largest_shift_m = 0.0;  ///< of a keyframe, relative to odometry
  double largest_turn_rad = 0.0;
};

/// Makes one map of a session of mini-maps with closed loops: merge() of the mini-maps with odometry's links between
/// neighbours. The keyframe shared by two neighbours becomes one. The same input and seed give the same result for any
/// number of threads.
///
/// A mini-map that the optimised graph leaves out keeps its odometry pose relative to its neighbour.
/// @param options of the mini-maps, which are never straightened and always adjusted. Unless candidates are given, all
///        pairs of up to 20 mini-maps are tried
/// @param min_observations leaves out landmarks of the map with fewer
/// @param session maps in metres whose keyframes have cameras and timestamps, as from map_sequence()
/// @throws Error (misuse) for invalid options or a session without maps, (cancelled)
ClosedLoops close_loops(const MappedSequence& session, const MergeOptions& options = {},
                        std::size_t min_observations = 1, const Execution& execution = {});

/// Default length of mini-maps for closing loops: short enough for small odometry errors within one, by
/// path and by rotation.
MiniMapLength usual_length_to_close_loops();

struct LoopClosedSequence {
  /// One map and its trajectory: with closed loops if any closed, else as from map_sequence().
  MappedSequence mapped;
  std::size_t mini_maps = 0;
  ClosedLoops loops;  ///< its map and trajectory were moved to `mapped`
};

/// map_sequence() and close_loops(). If no loop closes, maps the sequence again as one map.
/// @param mapping without mini_maps, the default length is used
/// @param options   as for close_loops()
/// @param execution its progress is that of close_loops(); MapSequenceOptions::on_frame tells that of the mapping
/// @throws Error as both
LoopClosedSequence map_and_close_loops(const ImageSequence& sequence, const Camera& camera,
                                       const MapSequenceOptions& mapping,
                                       const MergeOptions& options = {},
                                       const Execution& execution = {});

}  // namespace cairn
