// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/experiments/statistics/signed_rank.hpp"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/experiments/statistics/distributions.hpp"
#include "cairn/experiments/statistics/ranks.hpp"
#include "cairn/experiments/statistics/validation.hpp"

namespace cairn {
namespace {

constexpr std::size_t kMostExactByDefault = 50;
constexpr std::size_t kMostExact = 500;

// The null distribution of twice the sum of the ranks with a positive sign: entry s is P(2V = s).
// Twice, because ties make halves.
std::vector<double> null_distribution(const std::vector<double>& ranks) {
  std::vector<double> probability = {1.0};
  for (const double rank : ranks) {
    const auto step = static_cast<std::size_t>(std::lround(2.0 * rank));
    std::vector<double> next(probability.size() + step, 0.0);
    for (std::size_t s = 0; s < probability.size(); ++s) {
      next[s] += 0.5 * probability[s];
      next[s + step] += 0.5 * probability[s];
    }
    probability = std::move(next);
  }
  return probability;
}

// P(2V <= twice_sum).
double lower_tail(const std::vector<double>& distribution, std::size_t twice_sum) {
  double tail = 0.0;
  for (std::size_t s = 0; s <= twice_sum && s < distribution.size(); ++s) tail += distribution[s];
  return std::min(1.0, tail);
}

double combined(double less, double greater, Alternative alternative) {
  if (alternative == Alternative::kLess) return less;
  if (alternative == Alternative::kGreater) return greater;
  return std::min(1.0, 2.0 * std::min(less, greater));
}

double exact_p_value(const std::vector<double>& ranks, const SignedRank& sums,
                     Alternative alternative) {
  const std::vector<double> distribution = null_distribution(ranks);
  const auto twice = [](double sum) { return static_cast<std::size_t>(std::lround(2.0 * sum)); };
  // The distribution is symmetric: P(V >= v) = P(V <= total - v).
  return combined(lower_tail(distribution, twice(sums.positive_rank_sum)),
                  lower_tail(distribution, twice(sums.negative_rank_sum)), alternative);
}

double z_statistic(const Ranks& ranks, double positive_rank_sum, const SignedRankOptions& options) {
  const auto n = static_cast<double>(ranks.values.size());
  const double deviation = positive_rank_sum - n * (n + 1.0) / 4.0;
  const double variance = n * (n + 1.0) * (2.0 * n + 1.0) / 24.0 - ranks.tie_term() / 48.0;
  double correction = 0.0;
  if (options.continuity_correction) {
    if (options.alternative == Alternative::kGreater) {
      correction = 0.5;
    } else if (options.alternative == Alternative::kLess) {
      correction = -0.5;
    } else if (deviation != 0.0) {
      correction = std::copysign(0.5, deviation);
    }
  }
  return (deviation - correction) / std::sqrt(variance);
}

}  // namespace

SignedRank wilcoxon_signed_rank(std::span<const double> differences,
                                const SignedRankOptions& options) {
  require_finite("wilcoxon_signed_rank", differences);
  SignedRank result;
  std::vector<double> sizes;
  std::vector<bool> positive;
  for (const double difference : differences) {
    if (difference == 0.0) {
      ++result.zeros;
    } else {
      sizes.push_back(std::abs(difference));
      positive.push_back(difference > 0.0);
    }
  }
  result.used = sizes.size();
  if (sizes.empty()) return result;
  const Ranks ranks = mid_ranks(sizes);
  result.ties = !ranks.ties.empty();
  for (std::size_t i = 0; i < sizes.size(); ++i) {
    (positive[i] ? result.positive_rank_sum : result.negative_rank_sum) += ranks.values[i];
  }
  result.rank_biserial = (result.positive_rank_sum - result.negative_rank_sum) /
                         (result.positive_rank_sum + result.negative_rank_sum);
  result.exact = options.method == PValueMethod::kExact ||
                 (options.method == PValueMethod::kAutomatic && !result.ties &&
                  result.used <= kMostExactByDefault);
  if (result.exact) {
    if (result.used > kMostExact) {
      throw Error(ErrorKind::kMisuse, "SignedRankOptions.method",
                  fmt::format("an exact p-value of {} differences", result.used),
                  fmt::format("at most {}", kMostExact));
    }
    result.p_value = exact_p_value(ranks.values, result, options.alternative);
  } else {
    const double z = z_statistic(ranks, result.positive_rank_sum, options);
    result.z = z;
    result.p_value = combined(normal_cdf(z), normal_upper_tail(z), options.alternative);
  }
  return result;
}

std::optional<LocationShift> hodges_lehmann(std::span<const double> differences,
                                            double confidence) {
  constexpr std::size_t kMost = 10'000;
  require_finite("hodges_lehmann", differences);
  require_confidence("hodges_lehmann", confidence);
  if (differences.size() > kMost) {
    throw Error(ErrorKind::kMisuse, "hodges_lehmann",
                fmt::format("{} differences", differences.size()),
                fmt::format("at most {}", kMost));
  }
  if (differences.empty()) return std::nullopt;
  std::vector<double> means;
  means.reserve(differences.size() * (differences.size() + 1) / 2);
  for (std::size_t i = 0; i < differences.size(); ++i) {
    for (std::size_t j = i; j < differences.size(); ++j) {
      means.push_back(differences[i] + (differences[j] - differences[i]) / 2.0);
    }
  }
  std::sort(means.begin(), means.end());

  LocationShift shift;
  const std::size_t middle = means.size() / 2;
  shift.estimate = means.size() % 2 == 1
                       ? means[middle]
                       : means[middle - 1] + (means[middle] - means[middle - 1]) / 2.0;

  // The interval reaches from the `place`-th lowest to the `place`-th highest mean.
  std::size_t place = 1;
  if (differences.size() <= kMostExactByDefault) {
    std::vector<double> ranks(differences.size());
    for (std::size_t i = 0; i < ranks.size(); ++i) ranks[i] = static_cast<double>(i + 1);
    const std::vector<double> distribution = null_distribution(ranks);
    // The interval misses a shift whose V is below `at` on either side.
    const auto missed = [&](std::size_t at) {
      return 2.0 * lower_tail(distribution, 2 * (at - 1));
    };
    while (missed(place + 1) <= 1.0 - confidence && 2 * (place + 1) <= means.size()) ++place;
    shift.confidence = std::max(0.0, 1.0 - missed(place));
  } else {
    const auto n = static_cast<double>(differences.size());
    const double reach =
        normal_two_sided_quantile(confidence) * std::sqrt(n * (n + 1.0) * (2.0 * n + 1.0) / 24.0);
    place = static_cast<std::size_t>(std::max(1.0, std::floor(n * (n + 1.0) / 4.0 - reach)));
    shift.confidence = confidence;
  }
  shift.interval = {means[place - 1], means[means.size() - place]};
  return shift;
}

}  // namespace cairn
