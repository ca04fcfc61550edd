// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/experiments/detail/success_rate.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace cairn::detail {
namespace {

// The x > 0 at which an increasing function reaches the value; to the last bit, by halving.
template <class Function>
double inverse(const Function& function, double value) {
  double low = 0.0;
  double high = 1.0;
  while (function(high) < value) high *= 2.0;
  for (;;) {
    const double middle = 0.5 * (low + high);
    if (middle == low || middle == high) return middle;
    (function(middle) < value ? low : high) = middle;
  }
}

// P(|Z| < z) = confidence of the standard normal distribution.
double normal_quantile(double confidence) {
  return inverse([](double z) { return std::erf(z / std::numbers::sqrt2); }, confidence);
}

// P(|T| < t) = confidence of Student's distribution.
double student_quantile(double confidence, double degrees) {
  // The density of atan(T / sqrt(degrees)) is proportional to cos(.)^(degrees - 1); Simpson's rule.
  const double scale = 2.0 / std::sqrt(std::numbers::pi) *
                       std::exp(std::lgamma(0.5 * (degrees + 1.0)) - std::lgamma(0.5 * degrees));
  const auto within = [&](double t) {
    constexpr int kSteps = 2000;
    const double step = std::atan(t / std::sqrt(degrees)) / kSteps;
    double sum = 0.0;
    for (int i = 0; i <= kSteps; ++i) {
      const double weight = i == 0 || i == kSteps ? 1.0 : i % 2 == 1 ? 4.0 : 2.0;
      sum += weight * std::pow(std::cos(i * step), degrees - 1.0);
    }
    return scale * sum * step / 3.0;
  };
  return inverse(within, confidence);
}

// Of so many independent trials, which need not be whole. Never of zero width.
void set_wilson_interval(SuccessRate& rate, double p, double n, double z) {
  const double share = z * z / n;
  const double center = p + share / 2.0;
  const double reach = z * std::sqrt(p * (1.0 - p) / n + share / (4.0 * n));
  // The ends are exact where rounding would miss them by a bit.
  rate.low = p == 0.0 ? 0.0 : std::max(0.0, (center - reach) / (1.0 + share));
  rate.high = p == 1.0 ? 1.0 : std::min(1.0, (center + reach) / (1.0 + share));
}

}  // namespace

RateEstimator::RateEstimator(double confidence)
    : confidence_(confidence), z_(normal_quantile(confidence)) {}

SuccessRate RateEstimator::independent(SuccessCount count) const {
  SuccessRate rate{count};
  if (const auto p = rate.share()) {
    set_wilson_interval(rate, *p, static_cast<double>(count.trials), z_);
  }
  return rate;
}

SuccessRate RateEstimator::clustered(std::span<const SuccessCount> clusters) {
  SuccessRate rate;
  std::size_t used = 0;
  for (const SuccessCount& cluster : clusters) {
    rate.successes += cluster.successes;
    rate.trials += cluster.trials;
    if (cluster.trials > 0) ++used;
  }
  if (used < 2) return rate;
  const double p = *rate.share();
  const auto n = static_cast<double>(rate.trials);
  const auto count = static_cast<double>(used);
  double squares = 0.0;
  for (const SuccessCount& cluster : clusters) {
    const double residual =
        static_cast<double>(cluster.successes) - p * static_cast<double>(cluster.trials);
    squares += residual * residual;
  }
  const double variance = count / (count - 1.0) * squares / (n * n);
  const double effective = variance > 0.0 ? std::min(n, p * (1.0 - p) / variance) : count;
  const auto [t, is_new] = t_.try_emplace(used);
  if (is_new) t->second = student_quantile(confidence_, count - 1.0);
  const double ratio = z_ / t->second;
  set_wilson_interval(rate, p, effective * ratio * ratio, z_);
  return rate;
}

}  // namespace cairn::detail
