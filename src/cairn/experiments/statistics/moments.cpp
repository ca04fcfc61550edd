// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/experiments/statistics/moments.hpp"

#include <cmath>

namespace cairn {

std::optional<double> sample_mean(std::span<const double> values) {
  if (values.empty()) return std::nullopt;
  // About the first value, so that equal values have exactly that mean.
  double offset = 0.0;
  for (const double value : values) offset += value - values.front();
  return values.front() + offset / static_cast<double>(values.size());
}

std::optional<double> sample_deviation(std::span<const double> values) {
  if (values.size() < 2) return std::nullopt;
  const double mean = *sample_mean(values);
  double squares = 0.0;
  for (const double value : values) squares += (value - mean) * (value - mean);
  return std::sqrt(squares / static_cast<double>(values.size() - 1));
}

}  // namespace cairn
