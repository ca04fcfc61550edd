// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <span>
#include <vector>

#include "cairn/placement/verdict.hpp"

namespace cairn {

/// How likely each of some candidates is to be the right pose; what is missing to 1 is the probability
/// that none of them is.
///
/// A conditional logit model (McFadden 1974): the odds of a candidate against none grow with its evidence
/// a match (of distances, of looks, of descriptor matches), with its evidence of distances against those at
/// the other candidates and, where there are no descriptors, with how many times the matches within a
/// quarter of the radius of the best other candidate it has; they fall with the share of lines of sight
/// that contradict it. What the maps do not know has no say, and the rest weighs more then. Fitted to simulated
/// sessions of which half the pairs are of different places (docs/method.md).
///
/// @param prior_odds of two maps showing one place, against their showing two; positive
std::vector<double> probabilities(std::span<const PlacementCandidate> candidates,
                                  double prior_odds = 1.0);

}  // namespace cairn
