// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/experiments/statistics/ranks.hpp"

#include <algorithm>
#include <numeric>

namespace cairn {

double Ranks::tie_term() const {
  double sum = 0.0;
  for (const std::size_t size : ties) {
    const auto t = static_cast<double>(size);
    sum += t * t * t - t;
  }
  return sum;
}

Ranks mid_ranks(std::span<const double> values) {
  std::vector<std::size_t> order(values.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::sort(order.begin(), order.end(),
            [&](std::size_t a, std::size_t b) { return values[a] < values[b]; });
  Ranks result;
  result.values.resize(values.size());
  for (std::size_t begin = 0; begin < order.size();) {
    std::size_t end = begin + 1;
    while (end < order.size() && values[order[end]] == values[order[begin]]) ++end;
    // Ranks begin + 1 to end, and their mean.
    const double rank = 0.5 * static_cast<double>(begin + 1 + end);
    for (std::size_t i = begin; i < end; ++i) result.values[order[i]] = rank;
    if (end - begin > 1) result.ties.push_back(end - begin);
    begin = end;
  }
  return result;
}

}  // namespace cairn
