// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "cairn/map/landmark_map.hpp"

namespace cairn {

/// A rule for the confidence of each landmark of a map.
///
/// `evaluate` returns one number per landmark; higher means more confident. An alignment uses only the
/// order of these numbers, unless it weights the matches by them. A landmark that was never observed,
/// or whose input to the metric is unknown, has confidence 0 and is never matched. If the whole map
/// lacks an input, `evaluate` throws Error (input) naming the metric and the input.
struct Metric {
  std::string name;
  std::function<std::vector<double>(const LandmarkMap&)> evaluate;
};

enum class CovarianceNorm {
  kFrobenius,  ///< as computed by the paper's authors
  kSpectral,   ///< largest eigenvalue
};

/// w_c = 1 / (1 + ‖Cov‖), Eq. 1; Cov in the squared unit of length.
Metric covariance_metric(CovarianceNorm norm = CovarianceNorm::kFrobenius);

/// w_n = number of observations, Eq. 2.
Metric observations_metric();

/// w_d = 1 / (1 + D̄), Eq. 3, with D̄ the mean distance of the landmark from the centres of the cameras
/// that observed it, Eq. 4, in the map's unit of length.
Metric distance_metric();

inline constexpr std::size_t kMostViewingRays = 1000;

/// Largest angle between two viewing rays of the landmark, radians in [0, π]; a wider angle means a
/// more certain triangulated depth. 0 for a landmark observed from one place. Compares at most
/// kMostViewingRays observations, evenly spaced.
Metric parallax_metric();

/// 1 / (1 + mean reprojection error in pixels). Needs cameras; ignores observations in frames
/// without a camera. 0 for a landmark behind a camera that observed it.
Metric reprojection_metric();

/// A named column of the map; unknown values count as 0.
Metric column_metric(const std::string& column);

/// Product of several metrics, per landmark.
Metric product_metric(std::vector<Metric> factors);

/// The metric with this name: covariance, covariance:spectral, observations, distance, parallax,
/// reprojection, column:NAME, or a product of several joined by '*'.
/// @throws Error (misuse) listing the names if there is no such metric
Metric metric_named(std::string_view name);

/// The names that metric_named() accepts, for help texts.
std::vector<std::string> metric_names();

}  // namespace cairn
