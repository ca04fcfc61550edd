// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "cairn/core/statistics.hpp"
#include "cairn/map/landmark_map.hpp"

namespace cairn {

/// Default of the largest reprojection error of an inlier, pixels.
inline constexpr double kInlierPx = 2.0;

/// Reprojection errors of the observations.
struct ReprojectionStatistics {
  ErrorStatistics px;  ///< distances in the image, pixels
  /// Share of inliers among all observations in frames with a camera, including observations of
  /// landmarks behind the camera.
  double inlier_share = 0.0;
};

struct OctaveReprojection {
  std::int32_t octave = 0;
  ReprojectionStatistics statistics;
};

/// Consistency of a map with its own observations. No truth is needed, so a consistent map can
/// still be wrong as a whole.
struct MapConsistency {
  std::optional<ReprojectionStatistics>
      reprojection;                           ///< std::nullopt if no landmark could be projected
  std::vector<OctaveReprojection> by_octave;  ///< ascending; only observations with a known octave
  std::size_t observations_behind = 0;        ///< observations of landmarks behind the camera
  std::optional<ErrorStatistics> depth;       ///< |measured - map's depth|, the map's unit
  std::optional<double> depth_bias;           ///< mean of measured - map's depth, the map's unit

  /// Input missing from the map, e.g. "cameras of its frames"; empty if no input is missing.
  std::string missing_for_reprojection;
  std::string missing_for_depth;  ///< the same

  // One entry per observation, in the map's order; empty vectors if the map lacks the input.
  std::vector<std::optional<double>>
      reprojection_px;  ///< std::nullopt: no camera, or landmark behind it
  std::vector<std::optional<double>> depth_errors;  ///< measured - map's depth, signed
};

/// Compares each observation with the landmark's position in the observing keyframe: the pixel if
/// the frame has a camera, and the depth along the optical axis if a depth was measured.
/// @param inlier_px largest reprojection error of an inlier, pixels; positive
/// @throws Error (misuse) for any other inlier_px
MapConsistency map_consistency(const LandmarkMap& map, double inlier_px = kInlierPx);

/// Defects of a map, one sentence each: landmarks or frames without observations, landmarks at one
/// position or with one covariance, missing inputs of confidence metrics. No truth is needed.
std::vector<std::string> map_defects(const LandmarkMap& map);

/// Root mean square error of a keyframe's pose, from the map's pose covariances.
struct KeyframeUncertainty {
  double length = 0.0;  ///< in the map's unit
  double angle_rad = 0.0;
};

/// Uncertainty of the keyframes' poses relative to the first.
struct KeyframeUncertainties {
  FrameId worst;
  KeyframeUncertainty of_worst;
  /// Consecutive keyframes between which the variance of the angle grows most.
  std::pair<FrameId, FrameId> step;
  KeyframeUncertainty of_step;
};

/// Uncertainties from the map's pose covariances; std::nullopt if the map has none.
std::optional<KeyframeUncertainties> keyframe_uncertainties(const LandmarkMap& map);

}  // namespace cairn
