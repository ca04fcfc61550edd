// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>

namespace cairn::detail {

// Quantiles of chi² for squared residuals in standard deviations: two degrees of freedom for a pixel, one
// for a depth. Huber's kernel is quadratic up to 95 %; above 99 %, the noise does not explain a residual.
inline constexpr double kPixel95 = 5.991;
inline constexpr double kPixel99 = 9.210;
inline constexpr double kDepth95 = 3.841;
inline constexpr double kDepth99 = 6.635;

/// Weight of a squared residual in iteratively reweighted least squares with Huber's kernel.
inline double huber_weight(double squared, double quadratic_up_to) {
  return squared <= quadratic_up_to ? 1.0 : std::sqrt(quadratic_up_to / squared);
}

}  // namespace cairn::detail
