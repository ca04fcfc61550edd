// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "cairn/core/hash.hpp"
#include "cairn/registration/concepts.hpp"

namespace cairn {

/// Iterations that come again and again.
struct MatchCycle {
  int first = 0;   ///< iteration, from 1, whose matches came back
  int length = 0;  ///< after so many iterations; 1: a fixed point
};

/// Tells when the matches of an iteration are those of an earlier one.
///
/// The pose that a closed-form estimate ends an iteration with depends on its matches alone. So once
/// matches come back, all that follows is known: a fixed point if they are those of the iteration
/// before, else a limit cycle, which an ICP without a decreasing objective can fall into. Matches are
/// told apart by 128-bit hashes of which points they join.
class MatchHistory {
 public:
  /// Takes the matches of the next iteration.
  /// @return the cycle that they close, if an earlier iteration had the same
  std::optional<MatchCycle> add(std::span<const Match> matches);

 private:
  std::vector<Hash128> seen_;  // by iteration
};

}  // namespace cairn
