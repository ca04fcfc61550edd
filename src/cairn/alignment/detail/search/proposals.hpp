// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

/// Helpers of searches that propose poses from few landmarks and test each pose on the landmarks around them.
namespace cairn::detail {

/// Log-likelihood ratio of a binomial distribution versus chance, for the number of landmarks that a pose brings near
/// others. 0 if their share does not exceed that by chance.
/// @param chance share of landmarks that are near others by chance, in (0, 1)
inline double hit_evidence(std::size_t hits, std::size_t tested, double chance) {
  const auto count = static_cast<double>(hits);
  const double misses = static_cast<double>(tested) - count;
  const double share = count / static_cast<double>(tested);
  if (share <= chance) return 0.0;
  const double for_it = count * std::log(share / chance);
  return misses > 0.0 ? for_it + misses * std::log1p((chance - share) / (1.0 - chance)) : for_it;
}

/// The first poses, at most `most`, without those that equal an earlier one by `are_one`.
template <class Pose, class AreOne>
std::vector<Pose> first_distinct(const std::vector<Pose>& poses, std::size_t most,
                                 const AreOne& are_one) {
  std::vector<Pose> kept;
  for (const Pose& pose : poses) {
    if (kept.size() == most) break;
    const bool known = std::any_of(kept.begin(), kept.end(),
                                   [&](const Pose& other) { return are_one(pose, other); });
    if (!known) kept.push_back(pose);
  }
  return kept;
}

}  // namespace cairn::detail
