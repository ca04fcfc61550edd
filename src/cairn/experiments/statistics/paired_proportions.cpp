// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/experiments/statistics/paired_proportions.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/experiments/statistics/distributions.hpp"
#include "cairn/experiments/statistics/validation.hpp"

namespace cairn {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

// The correlation of the pairs as Newcombe's method 10 takes it.
double correlation(const PairedCounts& counts) {
  const auto a = static_cast<double>(counts.both);
  const auto b = static_cast<double>(counts.first_only);
  const auto c = static_cast<double>(counts.second_only);
  const auto d = static_cast<double>(counts.neither);
  const double margins = (a + b) * (c + d) * (a + c) * (b + d);
  if (margins == 0.0) return 0.0;
  double numerator = a * d - b * c;
  if (numerator > 0.0) numerator = std::max(0.0, numerator - (a + b + c + d) / 2.0);
  return numerator / std::sqrt(margins);
}

// The length of the third side of a triangle, which rounding may not make imaginary.
double third_side(double a, double b, double cosine) {
  return std::sqrt(std::max(0.0, a * a - 2.0 * cosine * a * b + b * b));
}

// Tango's z. There are pairs.
double score(const PairedCounts& counts, double delta) {
  const auto n = static_cast<double>(counts.pairs());
  const auto b = static_cast<double>(counts.first_only);
  const auto c = static_cast<double>(counts.second_only);
  const double linear = b + c - (2.0 * n - b + c) * delta;
  const double root = linear * linear + 8.0 * n * c * delta * (1.0 - delta);
  const double q = (linear + std::sqrt(std::max(0.0, root))) / (4.0 * n);
  const double deviation = b - c - n * delta;
  const double variance = n * (2.0 * q + delta * (1.0 - delta));
  if (deviation == 0.0) return 0.0;
  if (!(variance > 0.0)) return deviation > 0.0 ? kInfinity : -kInfinity;
  return deviation / std::sqrt(variance);
}

}  // namespace

PairedCounts count_pairs(const std::vector<bool>& first, const std::vector<bool>& second) {
  require_pairs("count_pairs", first.size(), second.size());
  PairedCounts counts;
  for (std::size_t i = 0; i < first.size(); ++i) {
    if (first[i]) {
      ++(second[i] ? counts.both : counts.first_only);
    } else {
      ++(second[i] ? counts.second_only : counts.neither);
    }
  }
  return counts;
}

double mcnemar_exact(const PairedCounts& counts) {
  const std::size_t fewer = std::min(counts.first_only, counts.second_only);
  return std::min(1.0, 2.0 * binomial_cdf(fewer, counts.discordant(), 0.5));
}

double mcnemar_mid_p(const PairedCounts& counts) {
  if (counts.discordant() == 0) return 1.0;
  const std::size_t fewer = std::min(counts.first_only, counts.second_only);
  const double observed = binomial_probability(fewer, counts.discordant(), 0.5);
  if (counts.first_only == counts.second_only) return 1.0 - 0.5 * observed;
  return 2.0 * binomial_cdf(fewer, counts.discordant(), 0.5) - observed;
}

ChiSquaredTest mcnemar_chi_squared(const PairedCounts& counts, bool continuity_correction) {
  ChiSquaredTest test;
  if (counts.discordant() == 0) return test;
  const double difference =
      std::abs(static_cast<double>(counts.first_only) - static_cast<double>(counts.second_only));
  const double corrected = continuity_correction ? std::max(0.0, difference - 1.0) : difference;
  test.statistic = corrected * corrected / static_cast<double>(counts.discordant());
  test.p_value = chi_squared_upper_tail(test.statistic, test.degrees_of_freedom);
  return test;
}

std::optional<ProportionDifference> paired_difference(const PairedCounts& counts,
                                                      double confidence) {
  require_confidence("paired_difference", confidence);
  if (counts.pairs() == 0) return std::nullopt;
  const double p = *counts.first().rate();
  const double q = *counts.second().rate();
  const Interval first = wilson_interval(counts.first(), confidence);
  const Interval second = wilson_interval(counts.second(), confidence);
  const double phi = correlation(counts);
  const double difference =
      (static_cast<double>(counts.first_only) - static_cast<double>(counts.second_only)) /
      static_cast<double>(counts.pairs());
  const double below = third_side(p - first.low, second.high - q, phi);
  const double above = third_side(first.high - p, q - second.low, phi);
  return ProportionDifference{
      difference, {std::max(-1.0, difference - below), std::min(1.0, difference + above)}};
}

std::optional<double> paired_score_statistic(const PairedCounts& counts, double hypothetical) {
  const bool is_difference = hypothetical > -1.0 && hypothetical < 1.0;
  if (!is_difference) {
    throw Error(ErrorKind::kMisuse, "paired_score_statistic",
                fmt::format("a difference of {}", hypothetical), "above -1 and below 1");
  }
  if (counts.pairs() == 0) return std::nullopt;
  return score(counts, hypothetical);
}

std::optional<ProportionDifference> paired_score_difference(const PairedCounts& counts,
                                                            double confidence) {
  require_confidence("paired_score_difference", confidence);
  if (counts.pairs() == 0) return std::nullopt;
  const double z = normal_two_sided_quantile(confidence);
  const double difference =
      (static_cast<double>(counts.first_only) - static_cast<double>(counts.second_only)) /
      static_cast<double>(counts.pairs());
  // The statistic falls as the hypothetical difference grows. Halving ends where doubles do.
  const auto crossing = [&](double low, double high, double level) {
    while (true) {
      const double middle = std::midpoint(low, high);
      if (middle <= low || middle >= high) return middle;
      (score(counts, middle) > level ? low : high) = middle;
    }
  };
  return ProportionDifference{difference,
                              {crossing(-1.0, difference, z), crossing(difference, 1.0, -z)}};
}

std::optional<DiscordantOdds> discordant_odds(const PairedCounts& counts, double confidence) {
  require_confidence("discordant_odds", confidence);
  if (counts.discordant() == 0) return std::nullopt;
  const auto odds = [](double p) { return p < 1.0 ? p / (1.0 - p) : kInfinity; };
  const Interval share =
      clopper_pearson_interval({counts.first_only, counts.discordant()}, confidence);
  const double ratio = counts.second_only == 0 ? kInfinity
                                               : static_cast<double>(counts.first_only) /
                                                     static_cast<double>(counts.second_only);
  return DiscordantOdds{ratio, {odds(share.low), odds(share.high)}};
}

}  // namespace cairn
