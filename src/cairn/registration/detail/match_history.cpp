// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/registration/detail/match_history.hpp"

#include <algorithm>
#include <cstdint>

namespace cairn::detail {

std::optional<MatchCycle> MatchHistory::add(std::span<const Match> matches) {
  std::vector<std::uint32_t> pairs;
  pairs.reserve(2 * matches.size());
  for (const Match& match : matches) {
    pairs.push_back(match.source);
    pairs.push_back(match.target);
  }
  const detail::Hash128 hash = detail::hash_of(
      {reinterpret_cast<const char*>(pairs.data()), pairs.size() * sizeof(std::uint32_t)});
  // The latest first, because most cycles are fixed points.
  const auto found = std::find(seen_.rbegin(), seen_.rend(), hash);
  std::optional<MatchCycle> cycle;
  if (found != seen_.rend()) {
    const auto length = static_cast<int>(found - seen_.rbegin()) + 1;
    cycle = MatchCycle{static_cast<int>(seen_.size()) + 1 - length, length};
  }
  seen_.push_back(hash);
  return cycle;
}

}  // namespace cairn::detail
