// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/placement/probability.hpp"

#include <algorithm>
#include <cmath>

namespace cairn {
namespace {

// What the logarithm of the odds is linear in.
struct Weights {
  double constant;
  double evidence;    // of the logarithm of 1 and the evidence
  double deviations;  // of tens of standard deviations by which the close support is more than that
                      // of other candidates
  double contradicted;  // of the logarithm of the odds of a line of sight being contradicted
  double likeness;      // of the logarithm of 1 and the evidence of descriptors
};

// Made by benchmarks/fit_placement_model.py from 1,210 pairs; docs/method.md has how well they predict others.
constexpr Weights kWithAll = {-9.026, 1.438, 4.172, -1.051, 0.680};
constexpr Weights kWithSight = {-8.877, 1.876, 4.943, -1.040, 0.0};
constexpr Weights kWithLikeness = {-5.630, 1.878, 4.010, 0.0, 0.809};
constexpr Weights kWithNeither = {-5.529, 2.455, 4.954, 0.0, 0.0};

const Weights& weights_for(const PlacementCandidate& candidate) {
  if (candidate.likeness) return candidate.contradicted ? kWithAll : kWithLikeness;
  return candidate.contradicted ? kWithSight : kWithNeither;
}

// By how many standard deviations a count is more than another (Anscombe 1948).
double deviations(double count, double other) {
  return 2.0 * (std::sqrt(count + 0.375) - std::sqrt(other + 0.375));
}

double log_odds(double share) {
  return std::log((share + 0.002) / (1.002 - share));
}

// Median close support of all candidates but one: those are wrong, or at least most of them.
double others_support(std::span<const PlacementCandidate> candidates, std::size_t but) {
  std::vector<double> supports;
  for (std::size_t i = 0; i < candidates.size(); ++i) {
    if (i != but) supports.push_back(candidates[i].close_support);
  }
  // Of a single one: as if there were another, clearly worse.
  if (supports.empty()) return 0.5 * candidates[but].close_support;
  std::sort(supports.begin(), supports.end());
  return 0.5 * (supports[(supports.size() - 1) / 2] + supports[supports.size() / 2]);
}

}  // namespace

std::vector<double> probabilities(std::span<const PlacementCandidate> candidates,
                                  std::size_t landmarks) {
  const auto count = static_cast<double>(landmarks);
  std::vector<double> result;
  double highest = 0.0;  // of the alternative that none is right
  for (std::size_t i = 0; i < candidates.size(); ++i) {
    const PlacementCandidate& candidate = candidates[i];
    const Weights& weights = weights_for(candidate);
    const double close = count * candidate.close_support;
    const double others = count * others_support(candidates, i);
    result.push_back(weights.constant + weights.evidence * std::log1p(candidate.spread_evidence) +
                     weights.deviations * 0.1 * deviations(close, others) +
                     weights.contradicted * log_odds(candidate.contradicted.value_or(0.5)) +
                     weights.likeness * std::log1p(candidate.spread_likeness));
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
