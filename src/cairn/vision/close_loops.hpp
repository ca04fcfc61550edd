// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "cairn/merging/merge.hpp"
#include "cairn/vision/map_sequence.hpp"

namespace cairn {

struct ClosedLoops {
  std::vector<Link> links;  ///< one per tried pair of mini-maps
  std::vector<bool> used;   ///< per link: whether it is aligned and agrees with the poses
  /// Number of used links between non-consecutive mini-maps.
  std::size_t closed = 0;
  /// Number of odometry links that contradict the closed loops.
  std::size_t odometry_refuted = 0;
  /// Merged map in the frame of the first mini-map. std::nullopt if no loop closed; the members
  /// below are then empty too.
  std::optional<LandmarkMap> map;
  Trajectory trajectory;  ///< corrected poses of all tracked frames
  MergeAdjustment adjustment;
  double largest_shift_m = 0.0;  ///< shift of a keyframe relative to odometry
  double largest_turn_rad = 0.0;
};

/// Merges the mini-maps of a session into one map with closed loops: merge() with the odometry
/// links between neighbours. The keyframe shared by two neighbours becomes one keyframe. The same
/// input and seed give the same result for any number of threads.
///
/// A mini-map that the optimised graph leaves out keeps its odometry pose relative to its neighbour.
/// @param options options of merge(); `straighten` is false and `adjust` true, whatever their
///        values. If links.candidates is not set, all pairs of up to 20 mini-maps are tried
/// @param min_observations leaves out landmarks with fewer observations in the merged map
/// @param session maps in metres whose keyframes have cameras and timestamps, as from map_sequence()
/// @throws Error (misuse) for invalid options or a session without maps, (cancelled)
ClosedLoops close_loops(const MappedSequence& session, const MergeOptions& options = {},
                        std::size_t min_observations = 1, const Execution& execution = {});

/// Default length of mini-maps for loop closure: 1 m of path or 45 degrees of rotation, which
/// limits the odometry error within a mini-map.
MiniMapLength usual_length_to_close_loops();

struct LoopClosedSequence {
  /// One map and its trajectory: from close_loops() if a loop closed, else from map_sequence().
  MappedSequence mapped;
  std::size_t mini_maps = 0;
  ClosedLoops loops;  ///< its map and trajectory were moved to `mapped`
};

/// Runs map_sequence() and close_loops(). If no loop closes, maps the sequence again as one map.
/// @param mapping   if mini_maps is std::nullopt, usual_length_to_close_loops() is used
/// @param options   as for close_loops()
/// @param execution reports close_loops(); MapSequenceOptions::on_frame reports the mapping
/// @throws Error as map_sequence() and close_loops()
LoopClosedSequence map_and_close_loops(const ImageSequence& sequence, const Camera& camera,
                                       const MapSequenceOptions& mapping,
                                       const MergeOptions& options = {},
                                       const Execution& execution = {});

}  // namespace cairn
