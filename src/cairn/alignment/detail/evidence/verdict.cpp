// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/alignment/detail/evidence/verdict.hpp"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "cairn/alignment/detail/evidence/seen_alike.hpp"

namespace cairn::detail {
namespace {

// Coefficients of the log odds.
struct Weights {
  double constant;
  double evidence;      // of the root of the evidence per match
  double proximity;     // of the logarithm of the evidence of distances versus those at other poses
  double lead;          // of lead() over the best other candidate
  double contradicted;  // of the logarithm of the odds of a line of sight being contradicted
  double agreement;     // of the logarithm of the evidence of descriptor matches
};

// Fitted by studies/fit_placement_model.py; docs/evidence.md reports how well they predict other pairs.
constexpr Weights kWithAll = {-13.162, 12.717, 1.500, 1.855, -0.369, 0.782};
constexpr Weights kWithDescriptors = {-11.064, 12.049, 1.347, 1.955, 0.0, 0.531};
constexpr Weights kWithSight = {-11.069, 7.201, 1.917, 0.094, -0.471, 0.0};
constexpr Weights kWithNeither = {-9.181, 9.346, 1.561, 0.297, 0.0, 0.0};

// Largest evidence of contrasts that is likely by chance.
constexpr double kContrastByChance = 5.0;

// Added to numbers of matches, so that few matches have little effect.
constexpr double kMatchesMore = 20.0;
constexpr double kLeadingMore = 3.0;
// Largest number of fine matches of two poses that are counted as independent.
constexpr double kMostIndependent = 160.0;
// Added to the log odds of a proven pose. Images that both maps contain prove that the maps show one place, and
// identify landmarks without doubt.
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

// Largest number of leading matches of any other candidate. For a single candidate, the number of an assumed, clearly
// worse one.
double leading_matches_of_others(std::span<const PlacementCandidate> candidates, std::size_t but) {
  if (candidates.size() == 1) return 0.5 * leading_matches(candidates[but]);
  double most = 0.0;
  for (std::size_t i = 0; i < candidates.size(); ++i) {
    if (i != but) most = std::max(most, leading_matches(candidates[i]));
  }
  return most;
}

// How far a candidate leads the best other one. Descriptor matches agree by chance in most wrong poses, so their ratio
// counts. Of landmarks alone, surfaces match in every pose; there, the evidence counts that both numbers have different
// means: about the log-likelihood ratio, negative for the smaller number. Matches of dense clouds are not independent.
double lead(std::span<const PlacementCandidate> candidates, std::size_t of) {
  const double own = leading_matches(candidates[of]);
  const double other = leading_matches_of_others(candidates, of);
  if (candidates[of].support.agreement) {
    return std::log((own + kLeadingMore) / (other + kLeadingMore));
  }
  const double share = std::min(1.0, kMostIndependent / std::max(own + other, 1.0));
  const double more = share * (own - other);
  return more * std::abs(more) / (2.0 * (share * (own + other) + kLeadingMore));
}

double contrast_spread(const Support& support) {
  return support.contrast && !support.agreement ? support.contrast->spread : 0.0;
}

// Logarithm of the evidence of contrasts, relative to the largest that is likely by chance and that of any other
// candidate. Colours that follow from the shape, such as a ramp of heights, correlate wherever shapes match.
double contrast_lead(std::span<const PlacementCandidate> candidates, std::size_t of) {
  double chance = kContrastByChance;
  for (std::size_t i = 0; i < candidates.size(); ++i) {
    if (i != of) chance = std::max(chance, contrast_spread(candidates[i].support));
  }
  return std::log(std::max(contrast_spread(candidates[of].support), chance) / chance);
}

// All evidence for a pose. Assumes that distances, descriptor similarity and descriptor matches are independent.
double evidence(const Support& support) {
  return support.spread_evidence + support.proximity.spread + support.spread_likeness +
         agreement_evidence(support);
}

// Share of the best pose's probability that makes another pose a rival.
constexpr double kRival = 0.05;
// For the surroundings of the matches; docs/evidence.md explains the choice.
constexpr std::size_t kFewestAround = 12;  // least number of landmarks for a decision
constexpr std::size_t kFewestIfAllAgree = 4;
constexpr double kLeastAgreeing = 0.4;  // share of these that must agree
// Radius of a ball, in matching radii. Matches in a smaller ball may belong to one object if nothing is known about the
// surroundings in either map. In a larger ball, surroundings may also hide each other, but then they hardly contradict.
constexpr double kLargestObject = 17.5;
// If all matches are in a ball that may be one object, one of these limits must hold: the least number of agreeing
// descriptor matches outside their largest cluster, or the largest share of contradicted lines of sight. The walls
// around several equal doors agree at each door, but not everything in front of the walls.
constexpr std::size_t kFewestOfObject = 20;
constexpr double kMostContradictedOfObject = 0.03;
constexpr double kMuchAround = 0.2;          // of each map's landmarks
constexpr double kLeastNotHidden = 0.07;     // share of landmarks that agree
constexpr double kHardlyContradicted = 0.1;  // of those that agree or are contradicted

// Where so many landmarks were seen alike, the maps may show two places that are built alike if less than this share of
// them has an agreeing descriptor match outside the largest cluster, and less than kLeastDistinctive is distinctive.
// docs/evidence.md explains the choice.
constexpr std::size_t kFewestSeenAlike = 40;
constexpr double kLeastAgreeingSeenAlike = 0.2;
// Fewer agreeing matches show that the maps' descriptors cannot be compared, e.g. because two programs computed them:
// places that are built alike have more in common.
constexpr std::size_t kFewestComparable = 3;

// Share of the best pose's evidence, of each kind. Another pose with so much evidence cannot be distinguished from the
// best pose. docs/evidence.md explains the choice.
constexpr double kAsWell = 0.5;
// Share of the best pose's agreeing descriptor matches outside their largest cluster, and their least number. Another
// pose with so many is not due to chance, even if fewer landmarks match.
constexpr double kAlsoAgreeing = 1.0 / 3.0;
constexpr std::size_t kFewestAlsoAgreeing = 5;
// Smaller differences of the share of contradicted lines of sight are not significant.
constexpr double kSameContradicted = 0.1;

std::string percent(double share) {
  return fmt::format("{:.1f} %", 100.0 * share);
}

// "the shift along (0.00, 1.00, 0.00) and the turn about ...": each open direction.
std::string open_text(const RegistrationResult& result) {
  std::string text;
  for (const OpenDirection& open : result.unobservable) {
    if (!text.empty()) text += " and ";
    const double shift = open.translation.norm();
    // Names the larger part; a rotation and a translation are equal if they move the landmarks equally.
    const double turn = open.rotation.norm();
    if (std::abs(open.log_scale) > std::max(shift, turn)) {
      text += "the scale";
    } else if (shift >= turn) {
      const Eigen::Vector3d axis = open.translation / shift;
      text += fmt::format("the shift along ({:.2f}, {:.2f}, {:.2f})", axis.x(), axis.y(), axis.z());
    } else {
      const Eigen::Vector3d axis = open.rotation / turn;
      text += fmt::format("the turn about ({:.2f}, {:.2f}, {:.2f})", axis.x(), axis.y(), axis.z());
    }
  }
  return text;
}

// Why the matches may be of one object in two places; empty if they are not.
std::string other_surroundings(const Surroundings& around, const PlacementCandidate& best) {
  const auto share = [](std::size_t part, std::size_t all) {
    return static_cast<double>(part) / static_cast<double>(all);
  };
  const auto& [agree, in_front, behind] = around.landmarks;
  const std::size_t compared = around.landmarks.total();
  if (around.extent == 0.0) return {};  // not known
  const auto& agreement = best.support.agreement;
  if (around.extent < kLargestObject && agreement && agreement->spread < kFewestOfObject &&
      best.contradicted.value_or(1.0) > kMostContradictedOfObject) {
    return fmt::format(
        "all matches are in a ball of {:.3g} matching radii, below the required {:g}, {} "
        "descriptor matches outside their largest cluster agree, fewer than {}, and {} of the "
        "lines of sight contradict it",
        around.extent, kLargestObject, agreement->spread, kFewestOfObject,
        best.contradicted ? percent(*best.contradicted) : "an unknown number");
  }
  if (compared < kFewestAround) {
    if (around.extent >= kLargestObject || around.share < kMuchAround) return {};
    if (agree >= kFewestIfAllAgree && agree == compared) return {};
    return fmt::format(
        "all matches are in a ball of {:.3g} matching radii, below the required {:g}, and {}",
        around.extent, kLargestObject,
        compared == 0 ? "no camera shows what is around it in either map"
                      : fmt::format("cameras of one map looked at {} landmarks of the other around "
                                    "it, fewer than {}",
                                    compared, kFewestAround));
  }
  if (share(agree, compared) >= kLeastAgreeing) return {};
  const bool hidden = share(agree, compared) >= kLeastNotHidden &&
                      share(in_front, agree + in_front) <= kHardlyContradicted;
  if (hidden && around.extent >= kLargestObject) return {};
  return fmt::format(
      "around the matches, {} of {} landmarks are at the depth that the other map's cameras saw, "
      "below the required {:g} %",
      percent(share(agree, compared)), compared, 100.0 * kLeastAgreeing);
}

// Why the maps may show two places that are built alike; empty if they do not.
std::string alike_places(const SeenAlike& seen, const PlacementCandidate& best) {
  const auto share = [&](std::size_t part) {
    return static_cast<double>(part) / static_cast<double>(seen.landmarks);
  };
  const std::size_t agreeing = agreement_spread(best.support);
  if (seen.landmarks < kFewestSeenAlike || agreeing < kFewestComparable) return {};
  if (share(agreeing) >= kLeastAgreeingSeenAlike || share(seen.distinctive) >= kLeastDistinctive) {
    return {};
  }
  return fmt::format(
      "of {} landmarks that cameras of both maps saw from the same side, {} look the same in both "
      "and like nothing else in either, below the required {:g} %, and {} descriptor matches "
      "agree, below {:g} %",
      seen.landmarks, seen.distinctive, 100.0 * kLeastDistinctive, agreeing,
      100.0 * kLeastAgreeingSeenAlike);
}

// Whether the landmarks match at another pose as well as at the best pose. The probability does not show this: it
// compares the match distances at each pose with those at all other poses, and along a fence many poses match equally
// well.
bool fits_as_well(const PlacementCandidate& other, const PlacementCandidate& best) {
  const bool contrasts_tell = contrast_evidence(best.support) >= kContrastByChance;
  const auto looks = [&](const Support& support) {
    return support.spread_likeness + agreement_evidence(support) +
           (contrasts_tell ? contrast_evidence(support) : 0.0);
  };
  const Support& there = other.support;
  const Support& here = best.support;
  for (std::size_t i = Support::kFine; i < Support::kRadii; ++i) {
    if (static_cast<double>(there.within[i]) < kAsWell * static_cast<double>(here.within[i])) {
      return false;
    }
  }
  return there.spread_evidence >= kAsWell * here.spread_evidence &&
         looks(there) >= kAsWell * looks(here) &&
         other.contradicted.value_or(0.0) <= best.contradicted.value_or(0.0) + kSameContradicted;
}

// Whether descriptors in several spots also agree with another pose, e.g. because a thing stands in two places.
bool looks_as_well(const PlacementCandidate& other, const PlacementCandidate& best) {
  const std::size_t there = agreement_spread(other.support);
  const std::size_t here = agreement_spread(best.support);
  return there >= kFewestAlsoAgreeing &&
         static_cast<double>(there) >= kAlsoAgreeing * static_cast<double>(here);
}

// What the next pose matches. It may match more than the best pose, but less closely.
std::string next_pose_text(std::span<const PlacementCandidate> candidates) {
  if (candidates.size() == 1) return "no other pose was found";
  const Support& best = candidates[0].support;
  const Support& next = candidates[1].support;
  std::string text = fmt::format("the next pose {}", percent(next.share));
  const std::size_t here = best.within[Support::kFine];
  const std::size_t there = next.within[Support::kFine];
  if (next.share > best.share && there < here) {
    text += fmt::format(" (but {} within a quarter of the radius, the best pose {})", there, here);
  }
  return text;
}

// The evidence for and against the best candidate.
std::string evidence_text(std::span<const PlacementCandidate> candidates, std::size_t landmarks) {
  const PlacementCandidate& best = candidates.front();
  std::string text =
      fmt::format("the best pose matches {} of {} landmarks one to one, {}",
                  percent(best.support.share), landmarks, next_pose_text(candidates));
  if (const auto& agreement = best.support.agreement; agreement && agreement->matches > 0) {
    if (agreement->identities > 0) {
      text += fmt::format(", {} of {} landmarks that keypoints of common images show agree with it",
                          agreement->identical, agreement->identities);
    }
    const std::size_t by_looks = agreement->matches - agreement->identities;
    if (by_looks > 0) {
      text +=
          fmt::format(", {} of {} descriptor matches agree with it ({:.1f} expected by chance)",
                      agreement->agreeing - agreement->identical, by_looks, agreement->expected);
    }
  }
  if (const auto& likeness = best.support.likeness; likeness && likeness->compared > 0) {
    const auto share =
        static_cast<double>(likeness->alike) / static_cast<double>(likeness->compared);
    text += fmt::format(", {} of the matches have similar descriptors ({} expected by chance)",
                        percent(share), percent(Likeness::kChance));
  }
  if (best.support.contrast && !best.support.agreement && contrast_evidence(best.support) > 0.0) {
    text += fmt::format(
        ", the lightness of {} matches relative to their neighbours has a correlation of {:.2f} "
        "(0 expected by chance)",
        best.support.contrast->compared, best.support.contrast->correlation);
  }
  if (best.contradicted) {
    text += fmt::format(", {} of the lines of sight contradict it", percent(*best.contradicted));
  }
  return text;
}

}  // namespace

std::vector<double> probabilities(std::span<const PlacementCandidate> candidates,
                                  double prior_odds) {
  std::vector<double> result;
  double highest = 0.0;  // log odds of the alternative that none is right
  for (std::size_t i = 0; i < candidates.size(); ++i) {
    const PlacementCandidate& candidate = candidates[i];
    const Weights& weights = weights_for(candidate);
    const double matches = static_cast<double>(candidate.support.matches()) + kMatchesMore;
    result.push_back(weights.constant + std::log(prior_odds) +
                     weights.evidence * std::sqrt(evidence(candidate.support) / matches) +
                     weights.proximity * std::log1p(candidate.support.proximity.spread) +
                     weights.lead * lead(candidates, i) +
                     weights.agreement * std::log1p(agreement_evidence(candidate.support)) +
                     weights.contradicted * log_odds(candidate.contradicted.value_or(0.5)) +
                     contrast_lead(candidates, i));
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

double agreement_evidence(const Support& support) {
  return support.agreement ? support.agreement->evidence() : 0.0;
}

double contrast_evidence(const Support& support) {
  return std::max(contrast_spread(support) - kContrastByChance, 0.0);
}

std::size_t agreement_spread(const Support& support) {
  return support.agreement ? support.agreement->spread : 0;
}

bool is_proven(const Support& support) {
  return support.agreement && support.agreement->is_proven();
}

bool is_decisive(const Support& support) {
  return agreement_spread(support) >= kDecisiveAgreement || is_proven(support);
}

bool is_decided(const Alignment& placed) {
  return !placed.candidates.empty() &&
         agreement_spread(placed.candidates.front().support) >= kDecisiveAgreement;
}

void take_pose(Alignment& alignment) {
  const RegistrationResult& result = alignment.registration;
  if (result.status != RegistrationStatus::kFailed) alignment.estimate = result.similarity();
  if (alignment.verdict == Verdict::kAligned) alignment.target_from_source = alignment.estimate;
}

Judgement judge(std::span<const PlacementCandidate> candidates, const RegistrationResult& result,
                std::size_t landmarks, double least, const Surroundings& around) {
  if (candidates.empty()) {
    return {Verdict::kRejected, "the search found no pose that matches landmarks"};
  }
  const PlacementCandidate& best = candidates.front();
  double any = 0.0;
  for (const PlacementCandidate& candidate : candidates) any += candidate.probability;
  const std::string found = fmt::format("{}: {}", decision_text(best.probability, least),
                                        evidence_text(candidates, landmarks));
  const auto ambiguous = [&](const std::string& why) {
    return Judgement{Verdict::kAmbiguous, fmt::format("{}; {}", why, found)};
  };
  if (best.probability >= least) {
    if (!result.unobservable.empty()) {
      return ambiguous("the matches do not determine " + open_text(result));
    }
    if (!result.covariance) {
      return ambiguous("the matches lie in too few places to compute a covariance");
    }
    if (is_proven(best.support)) return {Verdict::kAligned, found};
    const auto as_well = std::count_if(
        candidates.begin() + 1, candidates.end(),
        [&](const PlacementCandidate& candidate) { return fits_as_well(candidate, best); });
    if (as_well > 0) {
      return ambiguous(
          fmt::format("the landmarks match as well at {} other {}, as where a structure repeats",
                      as_well, as_well == 1 ? "pose" : "poses"));
    }
    const auto like = std::find_if(
        candidates.begin() + 1, candidates.end(),
        [&](const PlacementCandidate& candidate) { return looks_as_well(candidate, best); });
    if (like != candidates.end()) {
      return ambiguous(
          fmt::format("{} descriptor matches agree with another pose, {} with the best, as where a "
                      "thing stands twice",
                      like->support.agreement->agreeing, best.support.agreement->agreeing));
    }
    if (const std::string other = other_surroundings(around, best); !other.empty()) {
      return ambiguous("the maps may show two places that share one object: " + other);
    }
    if (const std::string alike = alike_places(around.seen_alike, best); !alike.empty()) {
      return ambiguous("the maps may show two places that are built alike: " + alike);
    }
    return {Verdict::kAligned, found};
  }
  if (any >= least) {
    const auto rivals = std::count_if(candidates.begin(), candidates.end(),
                                      [&](const PlacementCandidate& candidate) {
                                        return candidate.probability >= kRival * best.probability;
                                      });
    return ambiguous(rivals == 1 ? "other poses are not unlikely enough"
                                 : fmt::format("{} poses fit about equally well", rivals));
  }
  return {Verdict::kRejected, found};
}

}  // namespace cairn::detail
