// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "cairn/core/detail/hash.hpp"
#include "cairn/registration/result.hpp"

namespace cairn::detail {

/// Detects that the matches of an iteration equal those of an earlier one.
///
/// The closed-form pose after an iteration depends on its matches alone. Once matches repeat, all further
/// iterations are known: a fixed point if the matches equal those of the previous iteration, else a limit
/// cycle, which is possible because this ICP need not decrease an objective. Matches are compared by
/// 128-bit hashes of their index pairs.
class MatchHistory {
 public:
  /// Adds the matches of the next iteration.
  /// @return the cycle that these matches close, if an earlier iteration had the same matches
  std::optional<MatchCycle> add(std::span<const Match> matches);

 private:
  std::vector<detail::Hash128> seen_;  // by iteration
};

}  // namespace cairn::detail
