// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "cairn/adjustment/covariance_recovery.hpp"
#include "cairn/adjustment/measurements.hpp"
#include "cairn/core/execution.hpp"
#include "cairn/map/landmark_map.hpp"

namespace cairn {

struct CovarianceOptions {
  std::optional<MeasurementNoise> noise;  ///< std::nullopt: see estimated_noise()
  CovarianceGauge gauge = CovarianceGauge::kFirstFrame;
  /// If a landmark's residuals exceed the 95 % quantile, multiplies its covariance by the mean squared
  /// residual per degree of freedom (Birge ratio).
  bool widen_misfits = true;
  Execution execution = {};

  /// @throws Error (misuse) naming the field
  void validate() const;
};

struct EstimatedCovariances {
  LandmarkMap map;  ///< the map with the new covariances, without its UUID
  /// Per frame: the first of its group, relative to which its covariance is and those of the landmarks that
  /// it observed first; std::nullopt without usable observations.
  std::vector<std::optional<FrameIndex>> references;
  std::size_t known = 0;   ///< landmarks with a covariance
  MeasurementNoise noise;  ///< the assumed noise
};

/// Covariances of the landmarks and of the frames' poses of an adjusted map, from its observations: the marginals of
/// the least-squares problem of all frames and landmarks, in the map's squared unit of length.
///
/// Gauge: relative to the first frame of every group of frames that share landmarks. That frame's pose
/// counts as exact, so landmarks far from it are less certain. In a group without depths, the distance of
/// the frame farthest from the first also counts as exact; the covariances then hold for that scale. With
/// CovarianceGauge::kFirstObserver they are relative to the first frame that observed the landmark, as
/// odometry's are.
///
/// Unknown for landmarks that only one frame observed, without depth, and for landmarks that their
/// observations do not determine. Errors of observations are assumed independent. Landmarks and frames
/// without any observation keep the map's covariances, about which the observations say nothing.
///
/// @throws Error as adjust() and recover_covariances()
EstimatedCovariances estimate_covariances(const LandmarkMap& map,
                                          const CovarianceOptions& options = {});

}  // namespace cairn
