// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/placement/verdict.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "cairn/placement/probability_text.hpp"

namespace cairn {
namespace {

// Share of the best pose's probability that makes another a rival.
constexpr double kRival = 0.05;
// Of lines of sight to the surroundings of the matches; docs/method.md says how they were chosen.
constexpr std::size_t kFewestAround = 100;   // fewer say nothing
constexpr double kMostContradicted = 0.25;   // of those that agree or are contradicted
constexpr double kFewestInAgreement = 0.02;  // of all, with those that end behind what was seen

std::string percent(double share) {
  return fmt::format("{:.1f} %", 100.0 * share);
}

// "a shift along (0.00, 1.00, 0.00)", "a turn about ...", one a direction.
std::string open_text(const RegistrationResult& result) {
  std::string text;
  for (const OpenDirection& open : result.unobservable) {
    if (!text.empty()) text += " and ";
    const double shift = open.translation.norm();
    // A turn moves landmarks as a shift does at the distance where both are equal: the larger names it.
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

// What of the surroundings shows another place; empty where nothing does.
std::string other_surroundings(const SightCounts& around) {
  const auto share = [](std::size_t part, std::size_t all) {
    return static_cast<double>(part) / static_cast<double>(all);
  };
  const std::size_t compared = around.agree + around.in_front;
  if (compared >= kFewestAround && share(around.in_front, compared) > kMostContradicted) {
    return fmt::format("{} of {} lines of sight are contradicted",
                       percent(share(around.in_front, compared)), compared);
  }
  if (around.total() >= kFewestAround && share(around.agree, around.total()) < kFewestInAgreement) {
    return fmt::format("{} of {} lines of sight agree",
                       percent(share(around.agree, around.total())), around.total());
  }
  return {};
}

}  // namespace

std::string_view to_string(Verdict verdict) {
  switch (verdict) {
    case Verdict::kAligned:
      return "aligned";
    case Verdict::kAmbiguous:
      return "ambiguous";
    case Verdict::kRejected:
      return "rejected";
  }
  return "unknown";
}

Judgement judge(std::span<const PlacementCandidate> candidates, const RegistrationResult& result,
                std::size_t landmarks, double least, const SightCounts& around) {
  if (candidates.empty()) return {Verdict::kRejected, "no pose brings landmarks together"};
  const PlacementCandidate& best = candidates.front();
  double any = 0.0;
  for (const PlacementCandidate& candidate : candidates) any += candidate.probability;
  std::string found = fmt::format(
      "the best pose matches {} of {} landmarks one to one, {}", percent(best.support.share),
      landmarks,
      candidates.size() > 1 ? fmt::format("the next pose {}", percent(candidates[1].support.share))
                            : "there is no other");
  if (const auto& agreement = best.support.agreement; agreement && agreement->matches > 0) {
    found += fmt::format(", {} of {} descriptor matches agree with it ({:.1f} would by chance)",
                         agreement->agreeing, agreement->matches, agreement->expected);
  }
  if (const auto& likeness = best.support.likeness; likeness && likeness->compared > 0) {
    const auto share =
        static_cast<double>(likeness->alike) / static_cast<double>(likeness->compared);
    found += fmt::format(", {} of the matches look alike ({} would by chance)", percent(share),
                         percent(Likeness::kChance));
  }
  if (best.contradicted) {
    found += fmt::format(", {} of the lines of sight contradict it", percent(*best.contradicted));
  }
  if (best.probability >= least) {
    found += fmt::format(": right with a probability of {}", probability_text(best.probability));
    if (!result.unobservable.empty()) {
      return {Verdict::kAmbiguous,
              fmt::format("{}, but the maps do not determine {}", found, open_text(result))};
    }
    if (!result.covariance) {
      return {
          Verdict::kAmbiguous,
          fmt::format("{}, but landmarks match in too few places to say how exact it is", found)};
    }
    if (const std::string other = other_surroundings(around); !other.empty()) {
      return {
          Verdict::kAmbiguous,
          fmt::format(
              "{}, but the surroundings of the matches differ ({}): the maps may show two places "
              "that share one thing",
              found, other)};
    }
    return {Verdict::kAligned, std::move(found)};
  }
  if (any >= least) {
    const auto rivals = std::count_if(candidates.begin(), candidates.end(),
                                      [&](const PlacementCandidate& candidate) {
                                        return candidate.probability >= kRival * best.probability;
                                      });
    return {Verdict::kAmbiguous,
            fmt::format(
                "{}, but {} poses are about as good: this one is right with a probability of {}",
                found, rivals, probability_text(best.probability))};
  }
  return {Verdict::kRejected, fmt::format("{}: right with a probability of {} only", found,
                                          probability_text(best.probability))};
}

}  // namespace cairn
