// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/experiments/statistics/multiple_comparisons.hpp"

#include <algorithm>
#include <numeric>

#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/experiments/statistics/paired_proportions.hpp"
#include "cairn/experiments/statistics/signed_rank.hpp"
#include "cairn/experiments/statistics/validation.hpp"

namespace cairn {
namespace {

void adjust(std::vector<PairwiseComparison>& comparisons) {
  std::vector<double> p_values;
  p_values.reserve(comparisons.size());
  for (const PairwiseComparison& comparison : comparisons) {
    p_values.push_back(comparison.p_value);
  }
  const std::vector<double> adjusted = holm_adjusted(p_values);
  for (std::size_t i = 0; i < adjusted.size(); ++i) comparisons[i].adjusted = adjusted[i];
}

}  // namespace

std::vector<double> holm_adjusted(std::span<const double> p_values) {
  for (const double p : p_values) {
    const bool is_probability = p >= 0.0 && p <= 1.0;  // false of NaN
    if (!is_probability) {
      throw Error(ErrorKind::kMisuse, "holm_adjusted", fmt::format("a p-value of {}", p), "0 to 1");
    }
  }
  std::vector<std::size_t> order(p_values.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return p_values[a] < p_values[b]; });
  std::vector<double> adjusted(p_values.size());
  double largest = 0.0;
  for (std::size_t i = 0; i < order.size(); ++i) {
    const auto remaining = static_cast<double>(order.size() - i);
    largest = std::max(largest, std::min(1.0, remaining * p_values[order[i]]));
    adjusted[order[i]] = largest;
  }
  return adjusted;
}

std::vector<PairwiseComparison> pairwise_signed_rank(std::span<const std::vector<double>> blocks) {
  const std::size_t treatments = require_blocks("pairwise_signed_rank", blocks);
  std::vector<PairwiseComparison> comparisons;
  for (std::size_t a = 0; a < treatments; ++a) {
    for (std::size_t b = a + 1; b < treatments; ++b) {
      std::vector<double> differences;
      differences.reserve(blocks.size());
      for (const std::vector<double>& block : blocks) differences.push_back(block[a] - block[b]);
      const SignedRank test = wilcoxon_signed_rank(differences);
      comparisons.push_back({a, b, test.rank_biserial.value_or(0.0), test.p_value, 1.0});
    }
  }
  adjust(comparisons);
  return comparisons;
}

std::vector<PairwiseComparison> pairwise_mcnemar(std::span<const std::vector<bool>> successes) {
  if (successes.size() < 2) {
    throw Error(ErrorKind::kMisuse, "pairwise_mcnemar",
                fmt::format("{} treatments", successes.size()), "at least two");
  }
  std::vector<PairwiseComparison> comparisons;
  for (std::size_t a = 0; a < successes.size(); ++a) {
    for (std::size_t b = a + 1; b < successes.size(); ++b) {
      const PairedCounts counts = count_pairs(successes[a], successes[b]);
      const double difference =
          counts.first().rate().value_or(0.0) - counts.second().rate().value_or(0.0);
      comparisons.push_back({a, b, difference, mcnemar_exact(counts), 1.0});
    }
  }
  adjust(comparisons);
  return comparisons;
}

}  // namespace cairn
