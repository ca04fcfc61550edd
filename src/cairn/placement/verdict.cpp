// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/placement/verdict.hpp"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

namespace cairn {
namespace {

// By how much more of the landmarks a pose must match to stand clear of another. Between simulated
// scenes that have nothing but their kind in common the best pose matched up to 5 % more than the next,
// and up to 7 % more than there is beside it; see docs/method.md.
constexpr double kMargin = 0.08;
// And by how many standard deviations of the difference of two counts.
constexpr double kDeviations = 4.0;

bool clear(double support, double other, std::size_t landmarks) {
  const double deviation = std::sqrt((support + other) / static_cast<double>(landmarks));
  return support - other >= std::max(kMargin, kDeviations * deviation);
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
  if (!clear(best.support, best.chance, landmarks)) {
    return {Verdict::kRejected,
            fmt::format("{}, not clearly more than the {} beside it, where only "
                        "the scene's shape can match; the next pose has {}",
                        found, percent(best.chance), percent(second))};
  }
  if (clear(best.support, second, landmarks)) {
    return {Verdict::kAligned, fmt::format("{}, the next pose {}, and {} match beside it by chance",
                                           found, percent(second), percent(best.chance))};
  }
  const auto alike =
      std::count_if(candidates.begin(), candidates.end(), [&](const PlacementCandidate& candidate) {
        return !clear(best.support, candidate.support, landmarks);
      });
  return {Verdict::kAmbiguous, fmt::format("{}, but {} poses are about as good: the next has {}",
                                           found, alike, percent(second))};
}

}  // namespace cairn
