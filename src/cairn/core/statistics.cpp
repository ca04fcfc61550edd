// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/core/statistics.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include <fmt/format.h>

#include "cairn/core/error.hpp"

namespace cairn {
namespace {

double quantile_of_sorted(const std::vector<double>& sorted, double share) {
  const double place = share * static_cast<double>(sorted.size() - 1);
  const auto below = static_cast<std::size_t>(place);
  const std::size_t above = std::min(below + 1, sorted.size() - 1);
  return std::lerp(sorted[below], sorted[above], place - static_cast<double>(below));
}

std::vector<double> sorted_copy(std::span<const double> values) {
  std::vector<double> sorted(values.begin(), values.end());
  std::sort(sorted.begin(), sorted.end());
  return sorted;
}

}  // namespace

std::optional<ErrorStatistics> statistics_of(std::span<const double> errors) {
  if (errors.empty()) return std::nullopt;
  const std::vector<double> sorted = sorted_copy(errors);
  ErrorStatistics result;
  result.count = sorted.size();
  const auto count = static_cast<double>(sorted.size());
  double squares = 0.0;
  for (const double error : sorted) {
    result.mean += error / count;
    squares += error * error / count;
  }
  result.rmse = std::sqrt(squares);
  double deviations = 0.0;
  for (const double error : sorted) deviations += (error - result.mean) * (error - result.mean);
  result.standard_deviation = std::sqrt(deviations / count);
  result.lowest = sorted.front();
  result.median = quantile_of_sorted(sorted, 0.5);
  result.percentile_95 = quantile_of_sorted(sorted, 0.95);
  result.highest = sorted.back();
  return result;
}

double quantile(std::span<const double> values, double share) {
  if (values.empty()) throw Error(ErrorKind::kMisuse, "quantile", "no values", "at least one");
  const bool is_share = share >= 0.0 && share <= 1.0;  // false of NaN
  if (!is_share) {
    throw Error(ErrorKind::kMisuse, "quantile", fmt::format("a share of {}", share), "0 to 1");
  }
  return quantile_of_sorted(sorted_copy(values), share);
}

}  // namespace cairn
