// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "cairn/map/landmark_map.hpp"

namespace cairn {

/// A rule that says how far each landmark of a map can be trusted.
///
/// `evaluate` returns one number a landmark, the higher the surer; only their order matters to the
/// alignment, unless they are used as weights. 0 means that nothing vouches for the landmark (it was
/// never observed, or its own input is unknown): it is never chosen as a match. `evaluate` throws
/// Error (input) naming the metric and what is missing where a map lacks the input altogether.
struct Metric {
  std::string name;
  std::function<std::vector<double>(const LandmarkMap&)> evaluate;
};

enum class CovarianceNorm {
  kFrobenius,  ///< as the paper's authors computed it
  kSpectral,   ///< the largest eigenvalue
};

/// w_c = 1 / (1 + ‖Cov‖), Eq. 1; Cov in the square of the map's unit of length.
Metric covariance_metric(CovarianceNorm norm = CovarianceNorm::kFrobenius);

/// w_n = number of observations, Eq. 2.
Metric observations_metric();

/// w_d = 1 / (1 + D̄), Eq. 3, with D̄ the mean distance between the landmark and the centres of the
/// cameras that observed it, Eq. 4, in the map's unit of length.
Metric distance_metric();

/// The largest angle between two viewing rays of the landmark, radians in [0, π]: depth from
/// triangulation is the surer the wider it is. 0 for a landmark observed from one place only.
Metric parallax_metric();

/// 1 / (1 + mean distance in pixels between the observations and the landmark's projection). Needs
/// cameras; observations in frames without one are left out. 0 for a landmark behind a camera that
/// observed it.
Metric reprojection_metric();

/// A named column of the map, as it is; unknown values count as 0.
Metric column_metric(const std::string& column);

/// The product of several metrics, landmark by landmark.
Metric product_metric(std::vector<Metric> factors);

/// The metric of that name: covariance, covariance:spectral, observations, distance, parallax,
/// reprojection, column:NAME, or several of them joined by '*'.
/// @throws Error (misuse) listing the names if there is none
Metric metric_named(std::string_view name);

/// The names metric_named knows, for help texts.
std::vector<std::string> metric_names();

}  // namespace cairn
