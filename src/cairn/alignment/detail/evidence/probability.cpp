// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>

#include "cairn/alignment/detail/evidence/verdict.hpp"

namespace cairn::detail {
namespace {

// Coefficients of the log odds.
struct Weights {
  double constant;
  double evidence;      // of the root of the evidence per match
  double proximity;     // of the logarithm of the evidence of distances versus those at other poses
  double lead;          // of the log ratio of fine matches to those of the best other candidate
  double contradicted;  // of the logarithm of the odds of a line of sight being contradicted
};

// Fitted by studies/fit_placement_model.py; docs/evidence.md reports how well they predict other pairs.
constexpr Weights kWithAll = {-12.293, 12.076, 0.740, 0.0, -0.786};
constexpr Weights kWithDescriptors = {-9.095, 11.304, 0.775, 0.0, 0.0};
constexpr Weights kWithSight = {-10.875, 6.056, 1.379, 1.465, -0.816};
constexpr Weights kWithNeither = {-8.397, 6.702, 1.571, 1.122, 0.0};

// Added to numbers of matches, so that few matches have little effect.
constexpr double kMatchesMore = 20.0;
constexpr double kFineMore = 3.0;

const Weights& weights_for(const PlacementCandidate& candidate) {
  if (candidate.support.agreement) return candidate.contradicted ? kWithAll : kWithDescriptors;
  return candidate.contradicted ? kWithSight : kWithNeither;
}

double log_odds(double share) {
  return std::log((share + 0.002) / (1.002 - share));
}

double fine_matches(const PlacementCandidate& candidate) {
  return static_cast<double>(candidate.support.within[Support::kFine]);
}

// The largest number of any other candidate; for a single candidate, that of an assumed, clearly worse one.
double fine_matches_of_others(std::span<const PlacementCandidate> candidates, std::size_t but) {
  if (candidates.size() == 1) return 0.5 * fine_matches(candidates[but]);
  double most = 0.0;
  for (std::size_t i = 0; i < candidates.size(); ++i) {
    if (i != but) most = std::max(most, fine_matches(candidates[i]));
  }
  return most;
}

// Assumes that distances, descriptor similarity and descriptor matches are independent.
double evidence(const Support& support) {
  return support.spread_evidence + support.proximity.spread + support.spread_likeness +
         (support.agreement ? support.agreement->evidence() : 0.0);
}

}  // namespace

std::vector<double> probabilities(std::span<const PlacementCandidate> candidates,
                                  double prior_odds) {
  std::vector<double> result;
  double highest = 0.0;  // log odds of the alternative that none is right
  for (std::size_t i = 0; i < candidates.size(); ++i) {
    const PlacementCandidate& candidate = candidates[i];
    const Weights& weights = weights_for(candidate);
    const double lead = std::log((fine_matches(candidate) + kFineMore) /
                                 (fine_matches_of_others(candidates, i) + kFineMore));
    const double matches = static_cast<double>(candidate.support.matches()) + kMatchesMore;
    result.push_back(weights.constant + std::log(prior_odds) +
                     weights.evidence * std::sqrt(evidence(candidate.support) / matches) +
                     weights.proximity * std::log1p(candidate.support.proximity.spread) +
                     weights.lead * lead +
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

}  // namespace cairn::detail
