// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "cairn/core/error_statistics.hpp"
#include "cairn/map/landmark_map.hpp"

namespace cairn {

struct MapConsistencyOptions {
  double inlier_px = 2.0;  ///< an observation is an inlier below that; pixels, positive

  /// @throws Error (misuse) naming the field
  void validate() const;
};

/// How far observations are from where the map projects their landmarks to.
struct ReprojectionStatistics {
  ErrorStatistics px;         ///< distances in the image, pixels
  double inlier_share = 0.0;  ///< of all observations in frames with a camera, those of landmarks
                              ///< behind it among them
};

struct OctaveReprojection {
  std::int32_t octave = 0;
  ReprojectionStatistics statistics;
};

/// How well a map explains the observations that it was made from. Needs no truth: a map can be
/// consistent and yet wrong as a whole.
struct MapConsistency {
  std::optional<ReprojectionStatistics> reprojection;  ///< nothing if nothing could be projected
  std::vector<OctaveReprojection> by_octave;  ///< ascending; of observations whose octave is known
  std::size_t observations_behind = 0;        ///< of landmarks behind the camera that saw them
  std::optional<ErrorStatistics> depth;       ///< |measured - map's depth|, the map's unit
  std::optional<double> depth_bias;           ///< mean of measured - map's depth, the map's unit

  std::string missing_for_reprojection;  ///< what the map lacks, e.g. "cameras of its frames"
  std::string missing_for_depth;         ///< the same; empty if nothing

  // One entry an observation, in the map's order; empty vectors if the map lacks the input.
  std::vector<std::optional<double>> reprojection_px;  ///< nothing without camera, or behind it
  std::vector<std::optional<double>> depth_errors;     ///< measured - map's, signed
};

/// Compares each observation with the landmark's position in its keyframe: the pixel where the
/// frame's camera is known, the depth along the optical axis where one was measured.
MapConsistency map_consistency(const LandmarkMap& map, const MapConsistencyOptions& options = {});

}  // namespace cairn
