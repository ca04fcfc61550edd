// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <optional>

#include "cairn/adjustment/measurements.hpp"
#include "cairn/core/execution.hpp"
#include "cairn/map/landmark_map.hpp"

namespace cairn {

/// How residuals that the noise does not explain count.
enum class RobustKernel {
  kNone,    ///< as all others
  kHuber,   ///< linearly, from where 95 % of good ones lie
  kCauchy,  ///< logarithmically
};

struct AdjustOptions {
  /// std::nullopt: the map's own residuals tell, before and again after a first adjustment.
  std::optional<MeasurementNoise> noise;
  RobustKernel kernel = RobustKernel::kHuber;
  /// All parameters of all cameras, of which the given ones count as right to 2 % of the focal length, 1 %
  /// of the image's size and 0.05 of each other parameter (standard deviations).
  bool refine_intrinsics = false;
  int max_iterations = 50;  ///< of the solver, each time; at least 1
  /// Landmarks with fewer observations move with the first frame that observed them only. At least 1.
  std::size_t min_observations = 2;
  /// Computes the covariances of landmarks anew; see estimate_covariances(). Otherwise the result has none.
  bool covariances = true;
  /// The solver itself runs on one thread, so that sums have one order.
  Execution execution = {};

  /// @throws Error (misuse) naming the field
  void validate() const;
};

struct AdjustResult {
  LandmarkMap map;
  bool converged = false;        ///< else the iterations were used up, or no step made it better
  int iterations = 0;            ///< of the solver, all told
  std::size_t observations = 0;  ///< that took part
  std::size_t unusable = 0;      ///< the others: e.g. of landmarks behind the camera
  double initial_rms_px = 0.0;   ///< of those: root mean square distance from the pixels
  double final_rms_px = 0.0;     ///< the same of the result
  MeasurementNoise noise;        ///< that was assumed last
};

/// Full bundle adjustment: moves frames and landmarks, and cameras if asked, so that the squared residuals
/// of all observations (pixels, and depths of a map in metres, each over its standard deviation, with a
/// robust kernel) become least.
///
/// Gauge: the first frame stays where it is, of every group of frames that share landmarks; where a group has
/// no depths, so does the distance of the frame that is farthest from it. Frames without observations stay.
/// All else of the map is kept, without UUID. Same input, same result, whatever the number of threads.
///
/// @throws Error (misuse) for invalid options; (input) for a map without observations, a frame that observes
///         but has no camera; (cancelled)
AdjustResult adjust(const LandmarkMap& map, const AdjustOptions& options = {});

}  // namespace cairn
