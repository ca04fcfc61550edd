// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
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
  double standard_deviation = 0.0;  ///< about the mean; divisor: the count
  double lowest = 0.0;
  double percentile_95 = 0.0;  ///< see quantile()
  double highest = 0.0;
};

/// @param errors finite
/// @return std::nullopt if `errors` is empty
std::optional<ErrorStatistics> statistics_of(std::span<const double> errors);

/// Quantile of `values`, linearly interpolated as in numpy. `share` 0 is the minimum, 0.5 the
/// median, 1 the maximum.
/// @throws Error (misuse) if `values` is empty or `share` is outside [0, 1]
double quantile(std::span<const double> values, double share);

/// The value at index `rank` in ascending order, without interpolation. Runs in linear time and
/// reorders `values`, a vector.
/// @param rank less than the number of values
template <class Values>
auto nth_lowest(Values&& values, std::size_t rank) {
  const auto place = values.begin() + static_cast<std::ptrdiff_t>(rank);
  std::nth_element(values.begin(), place, values.end());
  return *place;
}

/// The median; for an even number of values, the upper of the two middle ones. Reorders `values`.
/// @param values not empty
template <class Values>
auto upper_median(Values&& values) {
  return nth_lowest(values, values.size() / 2);
}

/// Quantile at `share`, 0 to 1, rounded down to an existing value. Reorders `values`.
/// @param values not empty
template <class Values>
auto lower_quantile(Values&& values, double share) {
  return nth_lowest(values,
                    static_cast<std::size_t>(share * static_cast<double>(values.size() - 1)));
}

/// Quantisation step of values that are rounded or lie on a grid; 0 if there is none. A step
/// requires that at least 95 % of the values deviate by less than 5 % of the step from a grid with
/// arbitrary offset, that at least half of the values repeat, and that there are at least eight
/// distinct values.
double common_step(std::span<const double> values);

}  // namespace cairn
