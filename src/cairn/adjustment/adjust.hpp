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
  double pixel_px = 1.0;  ///< standard deviation of u and of v at octave 0; positive
  /// Ratio of the pixel sizes of consecutive octaves; from 1 to 4.
  double octave_scale = 1.2;
  /// Standard deviation of depth z, map's unit: depth_floor (> 0) + depth_quadratic (>= 0)·z².
  double depth_floor = 0.001;
  double depth_quadratic = 0.002;

  /// @throws Error (misuse) naming the field
  void validate() const;
  double sigma_px(std::int32_t octave) const;
  double sigma_depth(double depth) const { return depth_floor + depth_quadratic * depth * depth; }
};

/// Estimates the noise of an adjusted map from the medians of its residuals, corrected for the
/// number of fitted parameters. A fifth of the observations may be wrong. One factor scales both
/// depth_floor and depth_quadratic. With too few residuals, the values of `start` are kept.
/// @throws Error (input) for a map without observations or an observing frame without a camera
MeasurementNoise estimated_noise(const LandmarkMap& map, const MeasurementNoise& start = {});

struct AdjustOptions {
  /// std::nullopt: estimated from the residuals before and after a first adjustment.
  std::optional<MeasurementNoise> noise;
  /// Also adjusts the parameters of all cameras. The given parameters are the prior, with standard
  /// deviations of 2 % of the focal length, 1 % of the image size and 0.05 for each other
  /// parameter. EQUIRECTANGULAR cameras stay unchanged.
  bool refine_intrinsics = false;
  int max_iterations = 50;  ///< per run of the solver; at least 1
  /// A landmark with fewer observations moves only with its first observing frame. At least 1.
  std::size_t min_observations = 2;
  /// Recomputes the covariances; see estimate_covariances(). If false, the result has none.
  bool covariances = true;

  /// @throws Error (misuse) naming the field
  void validate() const;
};

struct AdjustResult {
  LandmarkMap map;
  bool converged = false;  ///< false: the iterations were used up, or no step improved the result
  int iterations = 0;      ///< solver iterations, in total
  std::size_t observations = 0;  ///< number of observations used
  std::size_t unusable = 0;      ///< other observations, e.g. of landmarks behind the camera
  double initial_rms_px = 0.0;   ///< root mean square reprojection error of the used observations
  double final_rms_px = 0.0;     ///< the same for the result
  MeasurementNoise noise;        ///< the noise last assumed
  /// See EstimatedCovariances::references; empty without covariances.
  std::vector<std::optional<FrameIndex>> covariance_references;
  /// Why requested covariances are missing: too many pairs of frames share landmarks. Empty
  /// otherwise.
  std::string why_no_covariances;
};

/// Full bundle adjustment: optimises frame poses, landmark positions and, if requested, camera
/// parameters. Minimises the robust squared residuals of all pixels and, for a map in metres, of
/// all depths. Each residual is divided by its standard deviation.
///
/// The frames of a rig at one instant move as one rigid body. Before the adjustment, their relative
/// poses are set to the rig's calibration.
///
/// Gauge: the first frame of every group of frames that share landmarks is fixed. In a group
/// without depths and rigs, the distance from the first frame to the farthest frame is fixed too.
/// Frames without observations do not move. The UUID is dropped; all other data of the map are
/// kept. If the covariances do not fit into memory, the adjusted map has none. The solver uses one
/// thread, so that the order of summation is fixed.
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
  /// Multiplies a landmark's covariance by the mean squared residual per degree of freedom (Birge
  /// ratio) if its residuals exceed the 95 % quantile of the chi-squared distribution.
  bool widen_misfits = true;

  /// @throws Error (misuse) naming the field
  void validate() const;
};

struct EstimatedCovariances {
  LandmarkMap map;  ///< the map with the new covariances, without its UUID
  /// Reference of each frame: the first frame of its group. The covariances of the frame and of
  /// landmarks first observed in the frame are relative to this reference. std::nullopt for a frame
  /// without usable observations.
  std::vector<std::optional<FrameIndex>> references;
  std::size_t known = 0;   ///< landmarks with a covariance
  MeasurementNoise noise;  ///< the assumed noise
};

/// Estimates the covariances of landmark positions and frame poses of an adjusted map from its
/// observations. The covariances are the marginals of the least-squares problem of all frames and
/// landmarks, in the map's squared unit of length. Frame poses: left perturbation (δt, δφ) in the
/// world, δφ in radians.
///
/// Gauge: covariances are relative to the first frame of every group of frames that share
/// landmarks. The pose of this frame counts as exact, so landmarks far from the frame are less
/// certain. The calibration of rigs counts as exact too. In a group without depths and rigs, the
/// distance from the first frame to the farthest frame also counts as exact; the covariances then
/// hold for that scale. With CovarianceGauge::kFirstObserver, landmark covariances are relative to
/// the first frame that observed the landmark, as in odometry.
///
/// The covariance is unknown for a landmark that only one frame observed without a depth, and for a
/// landmark that its observations do not determine. Observation errors are assumed independent.
/// Landmarks and frames without observations keep the map's covariances.
///
/// @throws Error as adjust(), and (input) if too many pairs of frames share landmarks for the
///        memory
EstimatedCovariances estimate_covariances(const LandmarkMap& map,
                                          const CovarianceOptions& options = {},
                                          const Execution& execution = {});

}  // namespace cairn
