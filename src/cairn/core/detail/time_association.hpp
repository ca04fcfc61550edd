// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <span>
#include <utility>
#include <vector>

namespace cairn::detail {

/// Positions in two lists, (first, second).
using IndexPairs = std::vector<std::pair<std::size_t, std::size_t>>;

/// Pairs the times of two clocks, as the TUM benchmark's associate.py does: takes pairs that differ by less
/// than `max_difference_s`, closest first, each time at most once. Equal differences are ordered by
/// position in `a`, then in `b`. O(n log n) for any difference.
/// @param a,b seconds, finite, strictly ascending
/// @return pairs in the order of `a`
IndexPairs associate_times(std::span<const double> a, std::span<const double> b,
                           double max_difference_s);

}  // namespace cairn::detail
