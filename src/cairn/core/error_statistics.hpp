// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <optional>
#include <span>

namespace cairn {

/// What several errors amount to, in their unit.
struct ErrorStatistics {
  std::size_t count = 0;
  double rmse = 0.0;  ///< root of the mean square
  double mean = 0.0;
  double median = 0.0;
  double standard_deviation = 0.0;  ///< about the mean, of these errors themselves: over count
  double lowest = 0.0;
  double percentile_95 = 0.0;  ///< see quantile()
  double highest = 0.0;
};

/// @param errors finite
/// @return nothing of no errors
std::optional<ErrorStatistics> statistics_of(std::span<const double> errors);

/// The value below which a share of `values` lies, linear between the two nearest, as numpy has it:
/// 0 is the lowest, 0.5 the median, 1 the highest.
/// @throws Error (misuse) of no values, or a share outside [0, 1]
double quantile(std::span<const double> values, double share);

}  // namespace cairn
