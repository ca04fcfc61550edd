// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cstddef>

namespace cairn::detail {

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

}  // namespace cairn::detail
