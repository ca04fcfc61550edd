// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "cairn/merging/fusion/fuse_and_adjust.hpp"
#include "cairn/merging/linking/link_maps.hpp"
#include "cairn/odometry/map_sequence.hpp"

namespace cairn {

struct CloseLoopsOptions {
  LinkOptions links = {};  ///< its execution and seed are taken from below
  /// Up to so many mini-maps every pair is tried; of more, those that look alike. At least 2.
  std::size_t most_with_all_pairs = 20;
  /// Of more mini-maps: so many that look most like it are tried for each. At least 1.
  std::size_t candidates = 10;
  double fusion_probability = 0.5;  ///< see FusionOptions
  AdjustOptions adjustment = {};    ///< its execution is taken from below
  int matching_rounds = 2;          ///< see FuseAndAdjustOptions
  /// Landmarks of the map with fewer observations are left out; at least 1.
  std::size_t min_observations = 1;
  std::uint64_t seed = 0;
  Execution execution = {};
  LogSink log = {};

  /// @throws Error (misuse) naming the field, its value and what it may be
  void validate() const;
};

struct ClosedLoops {
  std::vector<MapLink> links;  ///< of the pairs of mini-maps that were tried
  std::vector<bool> used;      ///< by link: aligned, and in agreement with the poses
  /// Links used between mini-maps that do not follow one another.
  std::size_t closed = 0;
  /// Odometry's links that disagree with what closed.
  std::size_t odometry_refuted = 0;
  /// In the frame of the first mini-map. std::nullopt if no loop closed; then what follows is empty too.
  std::optional<LandmarkMap> map;
  Trajectory trajectory;  ///< of all frames, corrected
  MergeAdjustment adjustment;
  double largest_shift_m = 0.0;  ///< of a keyframe, against odometry
  double largest_turn_rad = 0.0;
};

/// Makes one map of a session that was mapped as mini-maps, with its loops closed: pairs of mini-maps are
/// aligned and judged (link_maps()), odometry's links join neighbours, the pose graph is optimised
/// (optimise_poses()), landmarks are fused, all is adjusted, and landmarks are matched again
/// (fuse_and_adjust()). The keyframe that two neighbours share becomes one. Same input and seed, same
/// result, whatever the number of threads.
///
/// A mini-map that the optimised graph leaves out stays where odometry puts it beside its neighbour.
/// @param session maps in metres whose keyframes have cameras and timestamps, as map_sequence() makes them
/// @throws Error (misuse) for invalid options or a session without maps, (cancelled)
ClosedLoops close_loops(const MappedSequence& session, const CloseLoopsOptions& options = {});

/// How long the mini-maps are in which loops are looked for, where nothing else is said: so short that
/// odometry's errors within one are small, by path or by turning.
MiniMapLength usual_length_to_close_loops();

struct LoopClosedSequence {
  /// One map and its trajectory. With its loops closed if any did, else as map_sequence() makes it.
  MappedSequence mapped;
  std::size_t mini_maps = 0;
  ClosedLoops loops;  ///< its map and trajectory were moved to `mapped`
};

/// map_sequence() and close_loops(). Where nothing closes the sequence is mapped again in one piece.
/// @param mapping without mini_maps, the usual length is taken
/// @throws Error as both
LoopClosedSequence map_and_close_loops(const RgbdSequence& sequence, const Camera& camera,
                                       const MapSequenceOptions& mapping,
                                       const CloseLoopsOptions& options = {});

}  // namespace cairn
