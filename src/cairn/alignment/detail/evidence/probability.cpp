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
  double lead;          // of the log ratio of leading matches to those of the best other candidate
  double contradicted;  // of the logarithm of the odds of a line of sight being contradicted
  double agreement;     // of the logarithm of the evidence of descriptor matches
};

// Fitted by studies/fit_placement_model.py; docs/evidence.md reports how well they predict other pairs.
constexpr Weights kWithAll = {-13.162, 12.717, 1.500, 1.855, -0.369, 0.782};
constexpr Weights kWithDescriptors = {-11.064, 12.049, 1.347, 1.955, 0.0, 0.531};
constexpr Weights kWithSight = {-10.842, 5.814, 1.844, 1.435, -0.568, 0.0};
constexpr Weights kWithNeither = {-9.655, 6.621, 2.127, 2.220, 0.0, 0.0};

// Added to numbers of matches, so that few matches have little effect.
constexpr double kMatchesMore = 20.0;
constexpr double kLeadingMore = 3.0;
// Images that both maps contain prove that they show one place, and identify landmarks without doubt.
constexpr double kProven = 30.0;

const Weights& weights_for(const PlacementCandidate& candidate) {
  if (candidate.support.agreement) return candidate.contradicted ? kWithAll : kWithDescriptors;
  return candidate.contradicted ? kWithSight : kWithNeither;
}

double log_odds(double share) {
  return std::log((share + 0.002) / (1.002 - share));
}

// Agreeing descriptor matches outside their largest cluster; without descriptors, fine matches.
double leading_matches(const PlacementCandidate& candidate) {
  const Support& support = candidate.support;
  return static_cast<double>(support.agreement ? support.agreement->spread
                                               : support.within[Support::kFine]);
}

// The largest number of any other candidate; for a single candidate, that of an assumed, clearly worse one.
double leading_matches_of_others(std::span<const PlacementCandidate> candidates, std::size_t but) {
  if (candidates.size() == 1) return 0.5 * leading_matches(candidates[but]);
  double most = 0.0;
  for (std::size_t i = 0; i < candidates.size(); ++i) {
    if (i != but) most = std::max(most, leading_matches(candidates[i]));
  }
  return most;
}

// Assumes that distances, descriptor similarity and descriptor matches are independent.
double evidence(const Support& support) {
  return support.spread_evidence + support.proximity.spread + support.spread_likeness +
         agreement_evidence(support);
}

}  // namespace

std::vector<double> probabilities(std::span<const PlacementCandidate> candidates,
                                  double prior_odds) {
  std::vector<double> result;
  double highest = 0.0;  // log odds of the alternative that none is right
  for (std::size_t i = 0; i < candidates.size(); ++i) {
    const PlacementCandidate& candidate = candidates[i];
    const Weights& weights = weights_for(candidate);
    const double lead = std::log((leading_matches(candidate) + kLeadingMore) /
                                 (leading_matches_of_others(candidates, i) + kLeadingMore));
    const double matches = static_cast<double>(candidate.support.matches()) + kMatchesMore;
    result.push_back(weights.constant + std::log(prior_odds) +
                     weights.evidence * std::sqrt(evidence(candidate.support) / matches) +
                     weights.proximity * std::log1p(candidate.support.proximity.spread) +
                     weights.lead * lead +
                     weights.agreement * std::log1p(agreement_evidence(candidate.support)) +
                     weights.contradicted * log_odds(candidate.contradicted.value_or(0.5)));
    if (is_proven(candidate.support)) result.back() += kProven;
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
