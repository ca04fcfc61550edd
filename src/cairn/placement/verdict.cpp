// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/placement/verdict.hpp"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

namespace cairn {
namespace {

// By how much a support stands clear of another: so many times as much, and so many standard
// deviations of the difference of two counts.
struct Clearance {
  double ratio;
  double deviations;
};
// Best poses of simulated scenes that have nothing but their kind in common reached 1.74 times the
// next; see docs/method.md.
constexpr Clearance kOfRunnerUp = {1.8, 4.0};
// The support nearby was not optimised: that of any optimum exceeds it, by up to 2.9 times there.
constexpr Clearance kOfChance = {1.5, 4.0};
constexpr Clearance kOfChanceIfAmbiguous = {3.0, 5.0};

bool clear(double support, double other, std::size_t landmarks, const Clearance& clearance) {
  const auto count = static_cast<double>(landmarks);
  const double deviation = std::sqrt((support + other) / count);
  return support >= clearance.ratio * other && support - other >= clearance.deviations * deviation;
}

std::string percent(double share) {
  return fmt::format("{:.1f} %", 100.0 * share);
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

Judgement judge(std::span<const PlacementCandidate> candidates, std::size_t landmarks,
                double radius) {
  if (candidates.empty()) return {Verdict::kRejected, "no pose brings landmarks together"};
  const PlacementCandidate& best = candidates.front();
  const double second = candidates.size() > 1 ? candidates[1].support : 0.0;
  const std::string found =
      fmt::format("the best pose matches {} of {} landmarks one to one within {:.3g}",
                  percent(best.support), landmarks, radius);
  const bool clear_of_second = clear(best.support, second, landmarks, kOfRunnerUp);
  if (clear_of_second && clear(best.support, best.chance, landmarks, kOfChance)) {
    return {Verdict::kAligned, fmt::format("{}, the next {}, and {} match nearby by chance", found,
                                           percent(second), percent(best.chance))};
  }
  if (!clear_of_second && clear(best.support, best.chance, landmarks, kOfChanceIfAmbiguous)) {
    const auto alike = std::count_if(
        candidates.begin(), candidates.end(), [&](const PlacementCandidate& candidate) {
          return !clear(best.support, candidate.support, landmarks, kOfRunnerUp);
        });
    return {Verdict::kAmbiguous,
            fmt::format("{}, but {} poses are about as good: the next matches {}", found, alike,
                        percent(second))};
  }
  return {Verdict::kRejected,
          fmt::format("{}, which is not clear of the {} that the next pose matches and the {} that "
                      "match nearby by chance",
                      found, percent(second), percent(best.chance))};
}

}  // namespace cairn
