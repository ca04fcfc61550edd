// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "cairn/adjustment/measurements.hpp"
#include "cairn/core/execution.hpp"
#include "cairn/map/landmark_map.hpp"

namespace cairn {

/// Weight of residuals that the noise does not explain.
enum class RobustKernel {
  kNone,    ///< quadratic, like all others
  kHuber,   ///< linear beyond the 95 % quantile of good residuals
  kCauchy,  ///< logarithmic
};

struct AdjustOptions {
  /// std::nullopt: estimated from the map's residuals, before and again after a first adjustment.
  std::optional<MeasurementNoise> noise;
  RobustKernel kernel = RobustKernel::kHuber;
  /// Also adjusts all parameters of all cameras, with the given ones as a prior: standard deviations 2 % of
  /// the focal length, 1 % of the image size, and 0.05 for each other parameter.
  bool refine_intrinsics = false;
  int max_iterations = 50;  ///< per run of the solver; at least 1
  /// Landmarks with fewer observations only move with the first frame that observed them. At least 1.
  std::size_t min_observations = 2;
  /// Recomputes the covariances; see estimate_covariances(). If false, the result has none.
  bool covariances = true;
  /// The solver itself uses one thread, so that sums have one order.
  Execution execution = {};

  /// @throws Error (misuse) naming the field
  void validate() const;
};

struct AdjustResult {
  LandmarkMap map;
  bool converged = false;  ///< false: the iterations were used up, or no step improved the result
  int iterations = 0;      ///< of the solver, in total
  std::size_t observations = 0;  ///< that were used
  std::size_t unusable = 0;      ///< others, e.g. of landmarks behind the camera
  double initial_rms_px = 0.0;   ///< root mean square reprojection error of the used observations
  double final_rms_px = 0.0;     ///< the same for the result
  MeasurementNoise noise;        ///< the noise last assumed
  /// As of EstimatedCovariances; empty without covariances.
  std::vector<std::optional<FrameIndex>> covariance_references;
  /// Why the result has no covariances though they were requested: too many pairs of frames share landmarks.
  /// Empty otherwise.
  std::string why_no_covariances;
};

/// Full bundle adjustment: moves frames, landmarks and, if requested, cameras to minimise the squared
/// residuals of all observations (pixels, and depths of a map in metres, each divided by its standard
/// deviation, with a robust kernel).
///
/// Gauge: in every group of frames that share landmarks, the first frame is fixed; in a group without
/// depths, also the distance of the frame farthest from it. Frames without observations stay. All else of
/// the map is kept, but not its UUID. Where covariances are too large for the memory, the adjusted map has
/// none. The same input gives the same result for any number of threads.
///
/// @throws Error (misuse) for invalid options; (input) for a map without observations or an observing frame
///        without a camera; (cancelled)
AdjustResult adjust(const LandmarkMap& map, const AdjustOptions& options = {});

}  // namespace cairn
