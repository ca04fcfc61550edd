// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "cairn/core/execution.hpp"
#include "cairn/map/landmark_map.hpp"

namespace cairn {

/// Standard deviations of a map's measurements.
struct MeasurementNoise {
  double pixel_px = 1.0;  ///< of u and of v, at octave 0; positive
  /// Ratio of the pixel sizes of consecutive octaves; at least 1.
  double octave_scale = 1.2;
  /// Of depth z: floor + quadratic·z², in the map's unit. Positive; not negative.
  double depth_floor = 0.001;
  double depth_quadratic = 0.002;

  /// @throws Error (misuse) naming the field
  void validate() const;
  double sigma_px(std::int32_t octave) const;
  double sigma_depth(double depth) const { return depth_floor + depth_quadratic * depth * depth; }
};

/// Noise that explains the residuals of an adjusted map, from their medians, corrected for the fitted parameters;
/// robust to a fifth of wrong observations. The floor and the quadratic part of the depth noise are scaled by one
/// factor. Values with too few measurements stay as given.
/// @throws Error (input) for a map without observations or an observing frame without a camera
MeasurementNoise estimated_noise(const LandmarkMap& map, const MeasurementNoise& start = {});

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
  /// the focal length, 1 % of the image size, and 0.05 for each other parameter. EQUIRECTANGULAR has none to adjust.
  bool refine_intrinsics = false;
  int max_iterations = 50;  ///< per run of the solver; at least 1
  /// Landmarks with fewer observations only move with the first frame that observed them. At least 1.
  std::size_t min_observations = 2;
  /// Recomputes the covariances; see estimate_covariances(). If false, the result has none.
  bool covariances = true;

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
/// Frames that a rig took at one instant move as one, with the rig's poses held; first they are put there.
///
/// Gauge: in every group of frames that share landmarks, the first frame is fixed; in a group without
/// depths and rigs, also the distance of the frame farthest from it. Frames without observations stay. All else of
/// the map is kept, but not its UUID. Where covariances are too large for the memory, the adjusted map has
/// none. The solver itself uses one thread, so that sums have one order.
///
/// @throws Error (misuse) for invalid options; (input) for a map without observations or an observing frame
///        without a camera; (cancelled)
AdjustResult adjust(const LandmarkMap& map, const AdjustOptions& options = {},
                    const Execution& execution = {});

/// Frame of reference of the landmark covariances.
enum class CovarianceGauge {
  kFirstFrame,     ///< frame 0
  kFirstObserver,  ///< the frame of the landmark's first observation
};

struct CovarianceOptions {
  std::optional<MeasurementNoise> noise;  ///< std::nullopt: see estimated_noise()
  CovarianceGauge gauge = CovarianceGauge::kFirstFrame;
  /// If a landmark's residuals exceed the 95 % quantile, multiplies its covariance by the mean squared
  /// residual per degree of freedom (Birge ratio).
  bool widen_misfits = true;

  /// @throws Error (misuse) naming the field
  void validate() const;
};

struct EstimatedCovariances {
  LandmarkMap map;  ///< the map with the new covariances, without its UUID
  /// Reference of each frame: the first frame of its group. The covariances of the frame, and of the landmarks whose
  /// first observation is in it, are relative to this reference. std::nullopt for a frame without usable observations.
  std::vector<std::optional<FrameIndex>> references;
  std::size_t known = 0;   ///< landmarks with a covariance
  MeasurementNoise noise;  ///< the assumed noise
};

/// Covariances of the landmarks and of the frames' poses of an adjusted map, from its observations: the marginals of
/// the least-squares problem of all frames and landmarks, in the map's squared unit of length.
///
/// Gauge: relative to the first frame of every group of frames that share landmarks. That frame's pose
/// counts as exact, so landmarks far from it are less certain; so do the poses of rigs. In a group without depths and
/// rigs, the distance of the frame farthest from the first also counts as exact; the covariances then hold for that
/// scale. With CovarianceGauge::kFirstObserver they are relative to the first frame that observed the landmark, as
/// odometry's are.
///
/// Unknown for landmarks that only one frame observed, without depth, and for landmarks that their
/// observations do not determine. Errors of observations are assumed independent. Landmarks and frames
/// without any observation keep the map's covariances, about which the observations say nothing.
///
/// @throws Error as adjust() and recover_covariances()
EstimatedCovariances estimate_covariances(const LandmarkMap& map,
                                          const CovarianceOptions& options = {},
                                          const Execution& execution = {});

}  // namespace cairn
