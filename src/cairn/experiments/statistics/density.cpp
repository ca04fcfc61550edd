// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/experiments/statistics/density.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/core/statistics.hpp"
#include "cairn/experiments/statistics/interval.hpp"
#include "cairn/experiments/statistics/moments.hpp"
#include "cairn/experiments/statistics/validation.hpp"

namespace cairn {

std::optional<double> kernel_bandwidth(std::span<const double> values, BandwidthRule rule) {
  require_finite("kernel_bandwidth", values);
  const auto deviation = sample_deviation(values);
  if (!deviation || *deviation == 0.0) return std::nullopt;
  const double quartiles = (quantile(values, 0.75) - quantile(values, 0.25)) / 1.34;
  const double width = quartiles > 0.0 ? std::min(*deviation, quartiles) : *deviation;
  const double factor = rule == BandwidthRule::kSilverman ? 0.9 : 1.06;
  return factor * width * std::pow(static_cast<double>(values.size()), -0.2);
}

void DensityOptions::validate() const {
  const bool wide = !bandwidth || (std::isfinite(*bandwidth) && *bandwidth > 0.0);
  if (!wide) {
    throw Error(ErrorKind::kMisuse, "DensityOptions.bandwidth", fmt::format("{}", *bandwidth),
                "a positive number");
  }
  if (points < 2) {
    throw Error(ErrorKind::kMisuse, "DensityOptions.points", fmt::format("{}", points),
                "at least 2");
  }
  const bool reaches = std::isfinite(reach) && reach >= 0.0;
  if (!reaches) {
    throw Error(ErrorKind::kMisuse, "DensityOptions.reach", fmt::format("{}", reach),
                "a number of at least 0");
  }
}

std::optional<Density> kernel_density(std::span<const double> values,
                                      const DensityOptions& options) {
  options.validate();
  require_finite("kernel_density", values);
  const auto bandwidth =
      options.bandwidth ? options.bandwidth : kernel_bandwidth(values, options.rule);
  if (values.empty() || !bandwidth) return std::nullopt;
  Density result;
  result.bandwidth = *bandwidth;
  const auto [lowest, highest] = std::minmax_element(values.begin(), values.end());
  const double from = *lowest - options.reach * *bandwidth;
  const double to = *highest + options.reach * *bandwidth;
  const double scale =
      1.0 / (static_cast<double>(values.size()) * *bandwidth * std::sqrt(2.0 * std::numbers::pi));
  for (std::size_t i = 0; i < options.points; ++i) {
    const double position =
        std::lerp(from, to, static_cast<double>(i) / static_cast<double>(options.points - 1));
    double sum = 0.0;
    for (const double value : values) {
      const double u = (position - value) / *bandwidth;
      sum += std::exp(-0.5 * u * u);
    }
    result.positions.push_back(position);
    result.densities.push_back(sum * scale);
  }
  return result;
}

std::optional<BoxSummary> box_summary(std::span<const double> values) {
  require_finite("box_summary", values);
  if (values.empty()) return std::nullopt;
  std::vector<double> sorted(values.begin(), values.end());
  std::sort(sorted.begin(), sorted.end());
  BoxSummary result;
  result.count = sorted.size();
  result.lowest = sorted.front();
  result.lower_quartile = quantile(sorted, 0.25);
  result.median = quantile(sorted, 0.5);
  result.upper_quartile = quantile(sorted, 0.75);
  result.highest = sorted.back();
  const double reach = 1.5 * (result.upper_quartile - result.lower_quartile);
  const Interval fences{result.lower_quartile - reach, result.upper_quartile + reach};
  // Some value always lies within: the fences enclose the quartiles, which enclose the median.
  bool any = false;
  for (const double value : sorted) {
    if (!fences.contains(value)) {
      result.outliers.push_back(value);
      continue;
    }
    if (!any) result.lower_whisker = value;
    result.upper_whisker = value;
    any = true;
  }
  return result;
}

}  // namespace cairn
