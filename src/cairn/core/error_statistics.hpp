// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <optional>
#include <span>

namespace cairn {

/// Statistics of errors, in their unit.
struct ErrorStatistics {
  std::size_t count = 0;
  double rmse = 0.0;  ///< root mean square
  double mean = 0.0;
  double median = 0.0;
  double standard_deviation = 0.0;  ///< about the mean; divided by the count
  double lowest = 0.0;
  double percentile_95 = 0.0;  ///< see quantile()
  double highest = 0.0;
};

/// @param errors finite
/// @return std::nullopt for no errors
std::optional<ErrorStatistics> statistics_of(std::span<const double> errors);

/// Quantile of `values` at a share, linearly interpolated as in numpy: 0 is the lowest, 0.5 the median, 1
/// the highest.
/// @throws Error (misuse) for no values, or a share outside [0, 1]
double quantile(std::span<const double> values, double share);

}  // namespace cairn
