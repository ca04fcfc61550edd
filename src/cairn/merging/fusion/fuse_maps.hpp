// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "cairn/core/execution.hpp"
#include "cairn/core/log.hpp"
#include "cairn/geometry/similarity3.hpp"
#include "cairn/map/landmark_map.hpp"

namespace cairn {

/// A map and where it is.
struct PlacedMap {
  const LandmarkMap* map = nullptr;  ///< not null
  std::string name;                  ///< for the provenance
  Similarity3 world_from_map;
  /// Left perturbation in the world, (δt, δφ, δ log s); zero of the map whose frame is the world's.
  Matrix7d covariance = Matrix7d::Zero();
};

struct FusionOptions {
  /// From which probability two landmarks are one; in [0.5, 1].
  double min_probability = 0.5;
  std::uint64_t seed = 0;
  Execution execution = {};
  LogSink log = {};  ///< told what of the maps cannot be kept

  /// @throws Error (misuse) naming the field, its value and what it may be
  void validate() const;
};

/// What came of a map's landmarks.
struct MapFusion {
  std::size_t landmarks = 0;
  std::size_t fused = 0;  ///< became one with a landmark of a map before it
  /// By how much more than stated the landmarks that are one lie apart; see AssociationResult.
  double deviation = 0.0;
};

struct FusionResult {
  LandmarkMap map;
  std::vector<MapFusion> maps;  ///< one a map
};

/// Names of the columns of a fused map that say where each landmark came from.
inline constexpr const char* kFromMapColumn = "from_map";  ///< index of the first of its maps
inline constexpr const char* kFromLandmarkColumn = "from_landmark";  ///< id there; NaN above 2^53
inline constexpr const char* kFusedColumn = "fused";                 ///< how many landmarks it was

/// One map of several that are in one frame.
///
/// The maps are taken in their order. Landmarks of the next that are one with landmarks so far (associate())
/// are fused with them: position and covariance by their information, in which each map's pose and half the
/// deviation that the maps show take part. A pair is right with the probability that the association gives
/// it; the covariance is that of the mixture of both cases, so that doubt shows. Never are two landmarks of
/// one map fused. Where a part has no covariance, the position counts as exact to the deviation and
/// the result has no covariance.
///
/// Kept are all frames and observations, cameras (one of those that are alike), colours, descriptors of the
/// first kind, and named columns. Frames, cameras and landmarks are numbered anew from 0, frames in the order
/// of the maps; provenance and columns say where each came from. Length unit, world frame, and gravity are the first
/// map's. Same input and seed, same result, whatever the number of threads.
///
/// @throws Error (misuse) for no map or invalid options, (input) for more landmarks or frames than indices
FusionResult fuse_maps(std::span<const PlacedMap> maps, const FusionOptions& options = {});

}  // namespace cairn
