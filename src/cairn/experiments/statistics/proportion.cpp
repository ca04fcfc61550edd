// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/experiments/statistics/proportion.hpp"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/experiments/statistics/distributions.hpp"
#include "cairn/experiments/statistics/validation.hpp"

namespace cairn {

std::optional<double> SuccessCount::rate() const {
  if (trials == 0) return std::nullopt;
  return static_cast<double>(successes) / static_cast<double>(trials);
}

void SuccessCount::validate() const {
  if (successes > trials) {
    throw Error(ErrorKind::kMisuse, "SuccessCount",
                fmt::format("{} successes in {} trials", successes, trials),
                "at most as many successes as trials");
  }
}

namespace {

// Of so many independent trials, which need not be whole.
Interval wilson(double p, double n, double z) {
  const double share = z * z / n;
  const double center = p + share / 2.0;
  const double reach = z * std::sqrt(p * (1.0 - p) / n + share / (4.0 * n));
  // The ends are exact where rounding would miss them by a bit.
  return {p == 0.0 ? 0.0 : std::max(0.0, (center - reach) / (1.0 + share)),
          p == 1.0 ? 1.0 : std::min(1.0, (center + reach) / (1.0 + share))};
}

}  // namespace

Interval wilson_interval(SuccessCount count, double confidence) {
  count.validate();
  require_confidence("wilson_interval", confidence);
  if (count.trials == 0) return {0.0, 1.0};
  return wilson(*count.rate(), static_cast<double>(count.trials),
                normal_two_sided_quantile(confidence));
}

Interval clopper_pearson_interval(SuccessCount count, double confidence) {
  count.validate();
  require_confidence("clopper_pearson_interval", confidence);
  Interval interval{0.0, 1.0};
  const double tail = (1.0 - confidence) / 2.0;
  const auto x = static_cast<double>(count.successes);
  const auto failures = static_cast<double>(count.trials - count.successes);
  if (count.successes > 0) interval.low = beta_quantile(tail, x, failures + 1.0);
  if (count.successes < count.trials) interval.high = beta_quantile(1.0 - tail, x + 1.0, failures);
  return interval;
}

Proportion estimate_proportion(SuccessCount count, double confidence) {
  return {count, count.rate(), wilson_interval(count, confidence)};
}

Proportion clustered_proportion(std::span<const SuccessCount> clusters, double confidence) {
  require_confidence("clustered_proportion", confidence);
  SuccessCount all;
  double used = 0.0;
  for (const SuccessCount& cluster : clusters) {
    cluster.validate();
    all.successes += cluster.successes;
    all.trials += cluster.trials;
    if (cluster.trials > 0) used += 1.0;
  }
  Proportion result = {all, all.rate(), {0.0, 1.0}};
  if (used < 2.0) return result;
  const double p = *result.estimate;
  const auto n = static_cast<double>(all.trials);
  double squares = 0.0;
  for (const SuccessCount& cluster : clusters) {
    const double residual =
        static_cast<double>(cluster.successes) - p * static_cast<double>(cluster.trials);
    squares += residual * residual;
  }
  const double variance = used / (used - 1.0) * squares / (n * n);
  const double effective = variance > 0.0 ? std::min(n, p * (1.0 - p) / variance) : used;
  const double z = normal_two_sided_quantile(confidence);
  const double ratio = z / student_t_quantile(0.5 + 0.5 * confidence, used - 1.0);
  result.interval = wilson(p, effective * ratio * ratio, z);
  return result;
}

std::optional<ProportionDifference> independent_difference(SuccessCount first, SuccessCount second,
                                                           double confidence) {
  const Interval a = wilson_interval(first, confidence);
  const Interval b = wilson_interval(second, confidence);
  if (first.trials == 0 || second.trials == 0) return std::nullopt;
  const double p = *first.rate();
  const double q = *second.rate();
  return ProportionDifference{
      p - q,
      {p - q - std::hypot(p - a.low, b.high - q), p - q + std::hypot(a.high - p, q - b.low)}};
}

double cohens_h(double first, double second) {
  const bool are_proportions = first >= 0.0 && first <= 1.0 && second >= 0.0 && second <= 1.0;
  if (!are_proportions) {
    throw Error(ErrorKind::kMisuse, "cohens_h", fmt::format("proportions {} and {}", first, second),
                "0 to 1");
  }
  return 2.0 * (std::asin(std::sqrt(first)) - std::asin(std::sqrt(second)));
}

}  // namespace cairn
