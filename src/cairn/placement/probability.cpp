// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/placement/probability.hpp"

#include <algorithm>
#include <cmath>

namespace cairn {
namespace {

// What the logarithm of the odds is linear in.
struct Weights {
  double constant;
  double evidence;      // of the root of the evidence a match
  double lead;          // of the logarithm of how many times the close matches of the others it has
  double contradicted;  // of the logarithm of the odds of a line of sight being contradicted
};

// Made by benchmarks/fit_placement_model.py from 1,210 pairs; docs/method.md has how well they predict others.
constexpr Weights kWithAll = {-11.234, 13.506, 4.676, -1.287};
constexpr Weights kWithSight = {-9.916, 18.377, 5.432, -1.149};
constexpr Weights kWithLikeness = {-6.728, 15.328, 4.076, 0.0};
constexpr Weights kWithNeither = {-6.084, 23.175, 5.229, 0.0};

// So many more, so that a few say little.
constexpr double kMatchesMore = 20.0;
constexpr double kCloseMore = 3.0;
// More lead says no more: floors and walls of two rooms fit, too.
constexpr double kMostLead = 1.0;

const Weights& weights_for(const PlacementCandidate& candidate) {
  if (candidate.support.likeness) return candidate.contradicted ? kWithAll : kWithLikeness;
  return candidate.contradicted ? kWithSight : kWithNeither;
}

double log_odds(double share) {
  return std::log((share + 0.002) / (1.002 - share));
}

double close_matches(const PlacementCandidate& candidate) {
  return static_cast<double>(candidate.support.close_matches);
}

// Median of the close matches of all candidates but one: those are wrong, or at least most of them.
double close_matches_of_others(std::span<const PlacementCandidate> candidates, std::size_t but) {
  std::vector<double> counts;
  for (std::size_t i = 0; i < candidates.size(); ++i) {
    if (i != but) counts.push_back(close_matches(candidates[i]));
  }
  // Of a single one: as if there were another, clearly worse.
  if (counts.empty()) return 0.5 * close_matches(candidates[but]);
  std::sort(counts.begin(), counts.end());
  return 0.5 * (counts[(counts.size() - 1) / 2] + counts[counts.size() / 2]);
}

}  // namespace

std::vector<double> probabilities(std::span<const PlacementCandidate> candidates) {
  std::vector<double> result;
  double highest = 0.0;  // of the alternative that none is right
  for (std::size_t i = 0; i < candidates.size(); ++i) {
    const PlacementCandidate& candidate = candidates[i];
    const Weights& weights = weights_for(candidate);
    const Support& support = candidate.support;
    const double lead = std::log((close_matches(candidate) + kCloseMore) /
                                 (close_matches_of_others(candidates, i) + kCloseMore));
    const double matches = static_cast<double>(support.matches) + kMatchesMore;
    // As if where landmarks are and what they look like were independent of each other.
    const double evidence = support.spread_evidence + support.spread_likeness;
    result.push_back(weights.constant + weights.evidence * std::sqrt(evidence / matches) +
                     weights.lead * std::min(lead, kMostLead) +
                     weights.contradicted * log_odds(candidate.contradicted.value_or(0.5)));
    highest = std::max(highest, result.back());
  }
  double sum = std::exp(-highest);
  for (double& value : result) {
    value = std::exp(value - highest);
    sum += value;
  }
  for (double& value : result) value /= sum;
  return result;
}

}  // namespace cairn
