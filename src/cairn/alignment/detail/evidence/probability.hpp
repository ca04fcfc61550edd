// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <span>
#include <vector>

#include "cairn/alignment/evidence/verdict.hpp"

namespace cairn {

/// Probability of each candidate to be the right pose; 1 minus the sum is the probability that none is.
///
/// A conditional logit model (McFadden 1974). The odds of a candidate against none increase with its
/// evidence per match (of distances, descriptor similarity, descriptor matches), with its evidence of
/// distances against the other candidates and, without descriptors, with the ratio of its matches within a
/// quarter of the radius to those of the best other candidate. They decrease with the share of contradicted
/// lines of sight. If maps lack an input, that term is left out and the others have larger weights. Fitted
/// to simulated sessions, of which half the pairs show different places (docs/evidence.md).
///
/// @param prior_odds that two maps show one place, versus two; positive
std::vector<double> probabilities(std::span<const PlacementCandidate> candidates,
                                  double prior_odds = 1.0);

}  // namespace cairn
