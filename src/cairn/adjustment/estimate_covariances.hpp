// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <optional>

#include "cairn/adjustment/covariance_recovery.hpp"
#include "cairn/adjustment/measurements.hpp"
#include "cairn/core/execution.hpp"
#include "cairn/map/landmark_map.hpp"

namespace cairn {

struct CovarianceOptions {
  std::optional<MeasurementNoise> noise;  ///< std::nullopt: see estimated_noise()
  CovarianceGauge gauge = CovarianceGauge::kFirstFrame;
  /// A landmark whose residuals are larger than those of 95 % of good ones is as much less certain: its
  /// covariance is multiplied by the mean squared residual a degree of freedom (Birge ratio).
  bool widen_misfits = true;
  Execution execution = {};

  /// @throws Error (misuse) naming the field
  void validate() const;
};

struct EstimatedCovariances {
  LandmarkMap map;         ///< with them in place of those it had; else the same, without UUID
  std::size_t known = 0;   ///< landmarks that have one
  MeasurementNoise noise;  ///< that was assumed
};

/// Covariances of the landmarks of a map that was adjusted, from its observations: the marginals of the
/// whole least-squares problem of frames and landmarks, in the map's unit of length, squared.
///
/// Gauge: they are relative to the first frame, of every group of frames that share landmarks. That frame's
/// own pose counts as exact, so landmarks far from it are less certain. Where a group has no depths, the
/// distance of its farthest frame from the first counts as exact too: the covariances then hold for that
/// scale. With CovarianceGauge::kFirstObserver they are relative to the first frame that observed the
/// landmark, as odometry's are.
///
/// Unknown are those of landmarks that one frame observed, without depth, and of landmarks that their
/// observations do not determine. Errors of observations count as independent.
///
/// @throws Error as adjust(), and as recover_covariances()
EstimatedCovariances estimate_covariances(const LandmarkMap& map,
                                          const CovarianceOptions& options = {});

}  // namespace cairn
