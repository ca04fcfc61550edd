// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/registration/score/fitness.hpp"

#include <algorithm>
#include <numeric>

namespace cairn {

std::optional<double> fitness_score(std::span<const double> squared_distances) {
  if (squared_distances.empty()) return std::nullopt;
  return std::accumulate(squared_distances.begin(), squared_distances.end(), 0.0) /
         static_cast<double>(squared_distances.size());
}

std::optional<double> share_within(std::span<const double> squared_distances, double radius) {
  if (squared_distances.empty()) return std::nullopt;
  const auto within = std::count_if(squared_distances.begin(), squared_distances.end(),
                                    [&](double squared) { return squared <= radius * radius; });
  return static_cast<double>(within) / static_cast<double>(squared_distances.size());
}

}  // namespace cairn
