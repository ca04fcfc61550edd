// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/experiments/statistics/equivalence.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/experiments/statistics/distributions.hpp"
#include "cairn/experiments/statistics/moments.hpp"
#include "cairn/experiments/statistics/validation.hpp"

namespace cairn {
namespace {

void require_margin(Interval margin) {
  const bool is_margin =
      margin.low < margin.high && std::isfinite(margin.low) && std::isfinite(margin.high);
  if (!is_margin) {
    throw Error(ErrorKind::kMisuse, "tost_paired_means",
                fmt::format("a margin from {} to {}", margin.low, margin.high),
                "two finite numbers that ascend");
  }
}

void conclude(Equivalence& result) {
  result.p_value = std::max(result.p_low, result.p_high);
  result.equivalent = result.p_value < result.alpha;
}

}  // namespace

std::optional<Equivalence> tost_paired_means(const DifferenceSummary& differences, Interval margin,
                                             double alpha) {
  require_margin(margin);
  require_test_level("tost_paired_means", alpha);
  require_finite("tost_paired_means", std::array{differences.mean, differences.standard_deviation});
  if (differences.standard_deviation < 0.0) {
    throw Error(ErrorKind::kMisuse, "DifferenceSummary.standard_deviation",
                fmt::format("{}", differences.standard_deviation), "at least 0");
  }
  if (differences.count < 2) return std::nullopt;
  const auto n = static_cast<double>(differences.count);
  const double error = differences.standard_deviation / std::sqrt(n);
  const auto statistic = [&](double bound) {
    const double distance = differences.mean - bound;
    if (error > 0.0) return distance / error;
    return distance == 0.0 ? 0.0 : std::copysign(std::numeric_limits<double>::infinity(), distance);
  };
  Equivalence result;
  result.estimate = differences.mean;
  result.margin = margin;
  result.alpha = alpha;
  const double reach = student_t_quantile(1.0 - alpha, n - 1.0) * error;
  result.interval = {differences.mean - reach, differences.mean + reach};
  result.statistic_low = statistic(margin.low);
  result.statistic_high = statistic(margin.high);
  result.p_low = student_t_upper_tail(result.statistic_low, n - 1.0);
  result.p_high = student_t_upper_tail(-result.statistic_high, n - 1.0);
  conclude(result);
  return result;
}

std::optional<Equivalence> tost_paired_means(std::span<const double> differences, Interval margin,
                                             double alpha) {
  require_finite("tost_paired_means", differences);
  return tost_paired_means(
      DifferenceSummary{differences.size(), sample_mean(differences).value_or(0.0),
                        sample_deviation(differences).value_or(0.0)},
      margin, alpha);
}

std::optional<Equivalence> tost_paired_proportions(const PairedCounts& counts, double margin,
                                                   double alpha) {
  const bool is_margin = margin > 0.0 && margin < 1.0;
  if (!is_margin) {
    throw Error(ErrorKind::kMisuse, "tost_paired_proportions",
                fmt::format("a margin of {}", margin), "above 0 and below 1");
  }
  require_test_level("tost_paired_proportions", alpha);
  const auto difference = paired_score_difference(counts, 1.0 - 2.0 * alpha);
  if (!difference) return std::nullopt;
  Equivalence result;
  result.estimate = difference->estimate;
  result.margin = {-margin, margin};
  result.alpha = alpha;
  result.interval = difference->interval;
  result.statistic_low = *paired_score_statistic(counts, -margin);
  result.statistic_high = *paired_score_statistic(counts, margin);
  result.p_low = normal_upper_tail(result.statistic_low);
  result.p_high = normal_cdf(result.statistic_high);
  conclude(result);
  return result;
}

}  // namespace cairn
