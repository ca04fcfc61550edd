// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/core/statistics.hpp"

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

// Whether 19 in 20 ascending values are multiples of about this step from the first on; corrects the step.
bool is_step(const std::vector<double>& sorted, double& step) {
  constexpr double kMostOff = 0.05;  // of the step
  constexpr double kLeastShare = 0.95;
  std::vector<double> multiples = {0.0};
  for (std::size_t i = 1; i < sorted.size(); ++i) {
    multiples.push_back(multiples.back() + std::round((sorted[i] - sorted[i - 1]) / step));
  }
  if (!(multiples.back() > 0.0)) return false;
  step = (sorted.back() - sorted.front()) / multiples.back();
  const auto on_grid = [&](double offset) {
    return std::count_if(sorted.begin(), sorted.end(), [&](double value) {
      const double place = (value - offset) / step;
      return std::abs(place - std::round(place)) < kMostOff;
    });
  };
  const auto most = std::max(on_grid(sorted.front()), on_grid(sorted[sorted.size() / 2]));
  return static_cast<double>(most) >= kLeastShare * static_cast<double>(sorted.size());
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

double common_step(std::span<const double> values) {
  constexpr std::size_t kFewestSteps = 7;
  constexpr double kEqual = 1e-6;  // of the range; single precision keeps no more
  if (values.empty()) return 0.0;
  const std::vector<double> sorted = sorted_copy(values);
  const double range = sorted.back() - sorted.front();
  std::vector<double> steps;
  for (std::size_t i = 1; i < sorted.size(); ++i) {
    const double apart = sorted[i] - sorted[i - 1];
    if (apart > kEqual * range) steps.push_back(apart);
  }
  if (steps.size() < kFewestSteps || 2 * steps.size() > sorted.size()) return 0.0;
  for (const double share : {0.5, 0.25, 0.05}) {
    double step = lower_quantile(steps, share);
    if (is_step(sorted, step)) return step;
  }
  return 0.0;
}

}  // namespace cairn
