// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "cairn/alignment/prepared_map.hpp"

namespace cairn::detail {

/// From this many agreeing matches outside their largest cluster (DescriptorAgreement::spread), descriptors
/// decide alone.
inline constexpr std::size_t kDecisiveAgreement = 15;

/// DescriptorAgreement::evidence() and spread at a pose; 0 if the maps have no descriptors of one kind.
double agreement_evidence(const Support& support);
std::size_t agreement_spread(const Support& support);

/// DescriptorAgreement::is_proven(), if there is any.
bool is_proven(const Support& support);

/// Whether matches that are found without the pose decide for it, so that no search is needed.
bool is_decisive(const Support& support);

/// Whether descriptors alone decide for the likeliest candidate.
bool is_decided(const Alignment& placed);

/// Sets the estimate and, if the verdict is aligned, target_from_source to the pose of the registration.
void take_pose(Alignment& alignment);

/// Probability of each candidate to be the right pose; 1 minus the sum is the probability that none is.
///
/// A conditional logit model (McFadden 1974). The odds of a candidate against none increase with its
/// evidence per match (of distances, descriptor similarity, descriptor matches), with its evidence of
/// distances against the other candidates, with that of descriptor matches alone, however many other landmarks match,
/// and with the ratio of its matches to those of the best other candidate: descriptor matches that agree, or without
/// descriptors matches within a quarter of the radius. They decrease with the share of contradicted
/// lines of sight. If maps lack an input, that term is left out and the others have other weights. Fitted
/// to simulated sessions, of which half the pairs show different places (docs/evidence.md). A pose that is proven is right
/// beyond doubt.
///
/// @param prior_odds that two maps show one place, versus two; positive
std::vector<double> probabilities(std::span<const PlacementCandidate> candidates,
                                  double prior_odds = 1.0);

struct Judgement {
  Verdict verdict = Verdict::kRejected;
  std::string
      reason;  ///< one sentence for people: the decision and the number behind it, then the evidence
};

/// Judges the likeliest candidate. A pose without a covariance, with an open direction, with another pose at which
/// the landmarks match or look as well, or contradicted by the surroundings of its matches is at most ambiguous: an object
/// that stands in two places matches as well as a place does. Of these, only the first two apply to a pose that is proven.
///
/// @param candidates likeliest first
/// @param result     pose of the first candidate, with covariance and open directions
/// @param landmarks  number in the smaller map, to which the supports refer
/// @param least      least probability of an aligned pose
/// @param around     surroundings() of the first candidate
Judgement judge(std::span<const PlacementCandidate> candidates, const RegistrationResult& result,
                std::size_t landmarks, double least = 0.99, const Surroundings& around = {});

}  // namespace cairn::detail
