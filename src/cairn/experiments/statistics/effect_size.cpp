// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/experiments/statistics/effect_size.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include "cairn/experiments/statistics/distributions.hpp"
#include "cairn/experiments/statistics/moments.hpp"
#include "cairn/experiments/statistics/ranks.hpp"
#include "cairn/experiments/statistics/validation.hpp"

namespace cairn {

std::optional<double> cohens_dz(std::span<const double> differences) {
  require_finite("cohens_dz", differences);
  const auto deviation = sample_deviation(differences);
  if (!deviation || *deviation == 0.0) return std::nullopt;
  return *sample_mean(differences) / *deviation;
}

std::optional<Dominance> cliffs_delta(std::span<const double> first, std::span<const double> second,
                                      double confidence) {
  require_finite("cliffs_delta, first", first);
  require_finite("cliffs_delta, second", second);
  require_confidence("cliffs_delta", confidence);
  if (first.empty() || second.empty()) return std::nullopt;
  const auto n1 = static_cast<double>(first.size());
  const auto n2 = static_cast<double>(second.size());
  std::vector<double> pooled(first.begin(), first.end());
  pooled.insert(pooled.end(), second.begin(), second.end());
  const Ranks among_all = mid_ranks(pooled);
  const Ranks in_first = mid_ranks(first);
  const Ranks in_second = mid_ranks(second);

  // How much more often each value exceeds those of the other group than the reverse: its row or
  // column mean in the matrix of the signs of all differences.
  std::vector<double> rows(first.size());
  std::vector<double> columns(second.size());
  for (std::size_t i = 0; i < rows.size(); ++i) {
    rows[i] = 2.0 * (among_all.values[i] - in_first.values[i]) / n2 - 1.0;
  }
  for (std::size_t j = 0; j < columns.size(); ++j) {
    columns[j] = 1.0 - 2.0 * (among_all.values[rows.size() + j] - in_second.values[j]) / n1;
  }
  Dominance result;
  for (const double row : rows) result.delta += row / n1;
  result.vargha_delaney_a = (result.delta + 1.0) / 2.0;
  if (first.size() < 2 || second.size() < 2) return result;

  const double d = result.delta;
  double row_squares = 0.0;
  double column_squares = 0.0;
  for (const double row : rows) row_squares += (row - d) * (row - d);
  for (const double column : columns) column_squares += (column - d) * (column - d);
  // Pairs that differ have a sign whose square is 1.
  double equal_pairs = 0.0;
  std::vector<double> sorted(second.begin(), second.end());
  std::sort(sorted.begin(), sorted.end());
  for (const double value : first) {
    const auto range = std::equal_range(sorted.begin(), sorted.end(), value);
    equal_pairs += static_cast<double>(range.second - range.first);
  }
  const double all_squares = n1 * n2 - equal_pairs - n1 * n2 * d * d;
  const double unbiased = (n2 * n2 * row_squares + n1 * n1 * column_squares - all_squares) /
                          (n1 * n2 * (n1 - 1.0) * (n2 - 1.0));
  const double variance = std::max(unbiased, (1.0 - d * d) / (n1 * n2 - 1.0));
  const double t = student_t_quantile((1.0 + confidence) / 2.0, n1 + n2 - 2.0);
  const double spread = t * t * variance;
  const double rest = 1.0 - d * d;
  const double denominator = rest + spread;
  if (denominator > 0.0) {
    const double center = d * rest;
    const double reach = std::sqrt(spread) * std::sqrt(rest * rest + spread);
    result.interval = {std::max(-1.0, (center - reach) / denominator),
                       std::min(1.0, (center + reach) / denominator)};
  } else {
    result.interval = {d, d};
  }
  return result;
}

}  // namespace cairn
