// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <span>
#include <vector>

namespace cairn {

/// Ranks of some values among each other.
struct Ranks {
  std::vector<double> values;     ///< 1 for the lowest; equal values share the mean of their ranks
  std::vector<std::size_t> ties;  ///< sizes of the groups of equal values, those above 1 only

  /// Σ(t³ - t) over the groups of equal values: what ties take off the variance of rank statistics.
  double tie_term() const;
};

/// Mid-ranks. Values are tied if they are equal to the last bit: differences that rounding has kept
/// apart are to be rounded by the caller, who knows their resolution.
/// @param values no NaN
Ranks mid_ranks(std::span<const double> values);

}  // namespace cairn
