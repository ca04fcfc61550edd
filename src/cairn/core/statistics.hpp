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

/// The value with `rank` lower ones in ascending order, without interpolation. Takes linear time and reorders the
/// values, a vector.
/// @param rank less than the number of values
template <class Values>
auto nth_lowest(Values&& values, std::size_t rank) {
  const auto place = values.begin() + static_cast<std::ptrdiff_t>(rank);
  std::nth_element(values.begin(), place, values.end());
  return *place;
}

/// The median, of an even number of values the upper one of the two in the middle: see nth_lowest().
/// @param values not empty
template <class Values>
auto upper_median(Values&& values) {
  return nth_lowest(values, values.size() / 2);
}

/// The quantile at a share, 0 to 1, as the nearest value below: see nth_lowest().
/// @param values not empty
template <class Values>
auto lower_quantile(Values&& values, double share) {
  return nth_lowest(values,
                    static_cast<std::size_t>(share * static_cast<double>(values.size() - 1)));
}

/// The step of values that are rounded, or lie on a grid: 19 in 20 are multiples of it, from some offset, to within a
/// twentieth of it, with half of the values at least repeated. 0 if there is none, or for fewer than eight different
/// values.
double common_step(std::span<const double> values);

}  // namespace cairn
