// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/experiments/statistics/correlation.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/experiments/statistics/distributions.hpp"
#include "cairn/experiments/statistics/moments.hpp"
#include "cairn/experiments/statistics/ranks.hpp"
#include "cairn/experiments/statistics/validation.hpp"

namespace cairn {
namespace {

constexpr std::size_t kMostExact = 9;

std::vector<std::int64_t> twice(const std::vector<double>& ranks) {
  std::vector<std::int64_t> result;
  result.reserve(ranks.size());
  for (const double rank : ranks) result.push_back(std::llround(2.0 * rank));
  return result;
}

// The share of the permutations of one against the other whose correlation is no closer to 0.
double permutation_p_value(const Ranks& first, const Ranks& second) {
  const std::vector<std::int64_t> x = twice(first.values);
  std::vector<std::int64_t> y = twice(second.values);
  const auto n = static_cast<std::int64_t>(x.size());
  const std::int64_t mean = n * (n + 1) * (n + 1);  // of the sum of the products of doubled ranks
  const auto deviation = [&] {
    std::int64_t sum = 0;
    for (std::size_t i = 0; i < x.size(); ++i) sum += x[i] * y[i];
    return std::abs(sum - mean);
  };
  const std::int64_t observed = deviation();
  std::sort(y.begin(), y.end());
  std::size_t all = 0;
  std::size_t extreme = 0;
  do {
    ++all;
    if (deviation() >= observed) ++extreme;
  } while (std::next_permutation(y.begin(), y.end()));
  return static_cast<double>(extreme) / static_cast<double>(all);
}

}  // namespace

std::optional<double> pearson_correlation(std::span<const double> first,
                                          std::span<const double> second) {
  require_pairs("pearson_correlation", first.size(), second.size());
  require_finite("pearson_correlation, first", first);
  require_finite("pearson_correlation, second", second);
  if (first.size() < 2) return std::nullopt;
  const double x_mean = *sample_mean(first);
  const double y_mean = *sample_mean(second);
  double xx = 0.0;
  double yy = 0.0;
  double xy = 0.0;
  for (std::size_t i = 0; i < first.size(); ++i) {
    const double x = first[i] - x_mean;
    const double y = second[i] - y_mean;
    xx += x * x;
    yy += y * y;
    xy += x * y;
  }
  if (xx == 0.0 || yy == 0.0) return std::nullopt;
  return std::clamp(xy / (std::sqrt(xx) * std::sqrt(yy)), -1.0, 1.0);
}

std::optional<Spearman> spearman_correlation(std::span<const double> first,
                                             std::span<const double> second,
                                             const SpearmanOptions& options) {
  require_pairs("spearman_correlation", first.size(), second.size());
  require_finite("spearman_correlation, first", first);
  require_finite("spearman_correlation, second", second);
  require_confidence("SpearmanOptions.confidence", options.confidence);
  if (options.method == PValueMethod::kExact && first.size() > kMostExact) {
    throw Error(ErrorKind::kMisuse, "SpearmanOptions.method",
                fmt::format("an exact p-value of {} pairs", first.size()),
                fmt::format("at most {}", kMostExact));
  }
  if (first.size() < 3) return std::nullopt;
  const Ranks x = mid_ranks(first);
  const Ranks y = mid_ranks(second);
  const auto rho = pearson_correlation(x.values, y.values);
  if (!rho) return std::nullopt;
  Spearman result;
  result.pairs = first.size();
  result.rho = *rho;
  const auto n = static_cast<double>(result.pairs);
  const bool perfect = 1.0 - std::abs(*rho) < 4.0 * std::numeric_limits<double>::epsilon();
  if (perfect) result.rho = std::copysign(1.0, *rho);
  if (result.pairs > 3 && !perfect) {
    const double reach = normal_two_sided_quantile(options.confidence) *
                         std::sqrt((1.0 + *rho * *rho / 2.0) / (n - 3.0));
    result.interval =
        Interval{std::tanh(std::atanh(*rho) - reach), std::tanh(std::atanh(*rho) + reach)};
  }
  result.exact = options.method != PValueMethod::kAsymptotic && result.pairs <= kMostExact;
  if (result.exact) {
    result.p_value = permutation_p_value(x, y);
  } else {
    const double t = perfect ? std::numeric_limits<double>::infinity()
                             : std::abs(*rho) * std::sqrt((n - 2.0) / (1.0 - *rho * *rho));
    result.p_value = std::min(1.0, 2.0 * student_t_upper_tail(t, n - 2.0));
  }
  return result;
}

}  // namespace cairn
