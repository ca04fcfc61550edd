// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/registration/correspondence/confident_neighbor.hpp"

#include <cmath>
#include <numeric>

namespace cairn {

std::vector<Match> trimmed(std::vector<Match> matches, double trimmed_fraction) {
  const auto dropped =
      static_cast<std::size_t>(std::floor(trimmed_fraction * static_cast<double>(matches.size())));
  if (dropped == 0) return matches;
  std::vector<std::size_t> order(matches.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return matches[a].squared_distance < matches[b].squared_distance;
  });
  order.resize(matches.size() - dropped);
  std::sort(order.begin(), order.end());
  std::vector<Match> kept;
  kept.reserve(order.size());
  for (const std::size_t i : order) kept.push_back(matches[i]);
  return kept;
}

}  // namespace cairn
