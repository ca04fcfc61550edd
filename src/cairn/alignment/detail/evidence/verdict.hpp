// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "cairn/alignment/prepared_map.hpp"

namespace cairn::detail {

/// Least number of agreeing matches outside their largest cluster (DescriptorAgreement::spread) for which descriptors
/// decide alone.
inline constexpr std::size_t kDecisiveAgreement = 15;

/// ContrastAgreement::spread beyond what is likely by chance; 0 if descriptors or common images say more.
double contrast_evidence(const Support& support);

/// DescriptorAgreement::evidence() and spread at a pose; 0 without Support::agreement.
double agreement_evidence(const Support& support);
std::size_t agreement_spread(const Support& support);

/// DescriptorAgreement::is_proven(); false without Support::agreement.
bool is_proven(const Support& support);

/// Whether the matches that are found without the pose decide for this pose, so that no search is needed.
bool is_decisive(const Support& support);

/// Whether descriptors alone decide for the likeliest candidate.
bool is_decided(const Alignment& placed);

/// Sets the estimate to the pose of the registration, and target_from_source too if the verdict is aligned.
void take_pose(Alignment& alignment);

/// Probability of each candidate to be the right pose; 1 minus the sum is the probability that none is right.
///
/// A conditional logit model (McFadden 1974). The odds of a candidate against "none is right" increase with
/// - the candidate's evidence per match (of distances, descriptor similarity and descriptor matches),
/// - its evidence of distances against the other candidates,
/// - its evidence of descriptor matches alone, however many other landmarks match, and
/// - the ratio of its leading matches to those of the best other candidate. Leading matches are the agreeing descriptor
///   matches, or without descriptors the matches within a quarter of the radius.
///
/// The odds decrease with the share of contradicted lines of sight. If the maps lack an input, its term is left out and
/// the other terms have other weights. The weights are fitted to simulated sessions, of which half the pairs show
/// different places (docs/evidence.md). A proven pose is right beyond doubt.
///
/// @param prior_odds prior odds that the two maps show one place, versus two places; positive
std::vector<double> probabilities(std::span<const PlacementCandidate> candidates,
                                  double prior_odds = 1.0);

struct Judgement {
  Verdict verdict = Verdict::kRejected;
  std::string
      reason;  ///< one sentence for people: the decision and the number behind it, then the evidence
};

/// Judges the likeliest candidate. Its pose is at most ambiguous in each of these cases:
/// - it has no covariance;
/// - a direction is open;
/// - the landmarks match or look as well at another pose;
/// - the surroundings of its matches contradict it: an object that stands in two places matches as well as a place
///   does;
/// - hardly anything that both maps saw alike looks the same: two places may be built alike.
///
/// For a proven pose, only the first two cases apply.
///
/// @param candidates likeliest first
/// @param result     pose of the first candidate, with covariance and open directions
/// @param landmarks  number of landmarks in the smaller map, to which the supports refer
/// @param least      least probability of an aligned pose
/// @param around     surroundings() of the first candidate
Judgement judge(std::span<const PlacementCandidate> candidates, const RegistrationResult& result,
                std::size_t landmarks, double least = 0.99, const Surroundings& around = {});

}  // namespace cairn::detail
