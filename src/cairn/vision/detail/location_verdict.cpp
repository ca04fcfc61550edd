// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/vision/detail/location_verdict.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include <fmt/format.h>

#include "cairn/alignment/alignment.hpp"
#include "cairn/geometry/angles.hpp"
#include "cairn/geometry/decompositions.hpp"

namespace cairn::detail {
namespace {

// A logistic model, fitted to images of simulated places (docs/evidence.md).
constexpr double kConstant = -16.95;
constexpr double kMatches = 6.39;
constexpr double kUnmatched = -2.76;

// A match counts for no more than the evidence that there is for one, because chance finds many where landmarks are
// dense.
double independent_matches(const PoseEvidence& pose) {
  return std::min(static_cast<double>(pose.spread), pose.evidence);
}

double log_odds_without_matches(const PoseEvidence& pose) {
  // Of several wrong poses, the one that fits best by chance is found.
  return kConstant + kUnmatched * std::log1p(static_cast<double>(pose.unmatched_cells)) -
         std::log(static_cast<double>(pose.tried));
}

// How many independent matches would give the probability, if as many cells contradicted the pose.
double matches_for(const PoseEvidence& pose, double probability) {
  const double log_odds = std::log(probability / (1.0 - probability));
  return std::ceil(std::expm1((log_odds - log_odds_without_matches(pose)) / kMatches));
}

// Probability that a Gaussian error is at most so long: that of a chi-square distribution with the same mean and
// variance (Satterthwaite 1946), by the approximation of Wilson and Hilferty (1931).
double probability_within(double limit, const Eigen::Matrix3d& covariance) {
  const Eigen::Vector3d variances = symmetric_eigenvalues<3>(covariance);
  const double sum = variances.sum();
  if (!(sum > 0.0)) return 1.0;
  const double spread = 2.0 / 9.0 * variances.squaredNorm() / (sum * sum);
  const double deviation = (std::cbrt(limit * limit / sum) - (1.0 - spread)) / std::sqrt(spread);
  return 0.5 * std::erfc(-deviation / std::numbers::sqrt2);
}

}  // namespace

double log_odds(const PoseEvidence& pose) {
  return log_odds_without_matches(pose) + kMatches * std::log1p(independent_matches(pose));
}

double probability_of(const PoseEvidence& pose) {
  return 1.0 / (1.0 + std::exp(-log_odds(pose)));
}

Certainty certainty_of(const std::optional<Matrix6d>& covariance, double distance, double scale,
                       std::string_view unit) {
  constexpr double kRight = 0.05;         // metres
  constexpr double kRightShare = 0.01;    // of the distance; the larger counts
  constexpr double kRightRotation = 5.0;  // degrees
  constexpr std::string_view kWithout = "without the landmarks that may match by chance";
  if (!covariance) return {0.0, fmt::format("{}, the others leave the pose open", kWithout)};
  const Eigen::Matrix3d position = covariance->topLeftCorner<3, 3>();
  const Eigen::Matrix3d rotation = covariance->bottomRightCorner<3, 3>();
  return {probability_within(std::max(kRight, kRightShare * distance), position) *
              probability_within(radians(kRightRotation), rotation),
          fmt::format("{}, the position has a standard deviation of {:.2g} {}", kWithout,
                      std::sqrt(position.trace()) / scale, unit)};
}

Judged judged_by_matches(const PoseEvidence& best, const PoseEvidence* next, double min_probability,
                         std::string_view image, ImageLocation blank) {
  Judged judged{.result = std::move(blank), .found = "", .certainty = {}};
  ImageLocation& result = judged.result;
  result.probability = probability_of(best);
  judged.found = fmt::format(
      "{} of the {} landmarks projected near a corner match it ({:.1f} expected by chance)",
      best.agreeing, best.visible, best.expected);
  if (best.unmatched_cells > 0) {
    judged.found += fmt::format(", and {} of {} parts of {} match nothing that was seen there",
                                best.unmatched_cells, kImageCells, image);
  }
  if (next != nullptr && probability_of(*next) > kWorthCounting * result.probability) {
    const double other = probability_of(*next);
    // The odds of each versus none; at most one is right.
    const double odds = result.probability / (1.0 - result.probability);
    const double odds_of_other = other / (1.0 - other);
    result.probability = odds / (1.0 + odds + odds_of_other);
    judged.has_rival = true;
    judged.found += fmt::format(", and {} match at another pose", next->agreeing);
  }
  result.located = result.probability >= min_probability;
  result.failure.reset();
  if (!result.located && judged.has_rival) {
    result.failure = LocationFailure::kAmbiguous;
  } else if (!result.located) {
    constexpr double kChance = 0.01;  // a pose below it is hardly ever right
    result.failure =
        result.probability < kChance ? LocationFailure::kFewInliers : LocationFailure::kImprobable;
    judged.found +=
        fmt::format("; these count as {:.0f} independent matches, and {:.0f} would decide",
                    std::floor(independent_matches(best)), matches_for(best, min_probability));
  }
  return judged;
}

ImageLocation with_certainty(Judged judged, double min_probability) {
  ImageLocation& result = judged.result;
  const bool by_matches = result.located || result.failure == LocationFailure::kFewInliers ||
                          result.failure == LocationFailure::kImprobable ||
                          result.failure == LocationFailure::kAmbiguous;
  if (!by_matches) return std::move(result);
  result.probability *= judged.certainty.probability;
  if (result.located && result.probability < min_probability) {
    result.located = false;
    result.failure = LocationFailure::kUndetermined;
    result.world_from_camera.reset();
    judged.found += "; " + judged.certainty.text;
  }
  result.reason =
      fmt::format("{}: {}", decision_text(result.probability, min_probability), judged.found);
  return std::move(result);
}

}  // namespace cairn::detail
