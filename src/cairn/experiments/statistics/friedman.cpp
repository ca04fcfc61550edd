// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/experiments/statistics/friedman.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <map>
#include <utility>

#include "cairn/experiments/statistics/distributions.hpp"
#include "cairn/experiments/statistics/ranks.hpp"
#include "cairn/experiments/statistics/validation.hpp"

namespace cairn {
namespace {

// Twice the ranks, which are whole numbers whatever the ties.
using TwiceRanks = std::vector<std::int64_t>;

struct RankedBlocks {
  std::size_t treatments = 0;
  std::vector<TwiceRanks> ranks;  // one per block
  TwiceRanks sums;                // one per treatment
  std::int64_t squares = 0;       // Σ (2r - (k+1))² over everything
};

RankedBlocks ranked(std::span<const std::vector<double>> blocks, std::size_t treatments) {
  RankedBlocks result;
  result.treatments = treatments;
  result.sums.assign(treatments, 0);
  for (const std::vector<double>& block : blocks) {
    const Ranks ranks = mid_ranks(block);
    TwiceRanks twice(treatments);
    for (std::size_t t = 0; t < treatments; ++t) {
      twice[t] = std::llround(2.0 * ranks.values[t]);
      const std::int64_t deviation = twice[t] - static_cast<std::int64_t>(treatments + 1);
      result.sums[t] += twice[t];
      result.squares += deviation * deviation;
    }
    result.ranks.push_back(std::move(twice));
  }
  return result;
}

// Σ (R - mean)² of the rank sums, doubled ranks: what the statistic grows with.
std::int64_t spread(const TwiceRanks& sums, std::size_t blocks) {
  const auto mean = static_cast<std::int64_t>(blocks * (sums.size() + 1));
  std::int64_t total = 0;
  for (const std::int64_t sum : sums) total += (sum - mean) * (sum - mean);
  return total;
}

// The exact p-value, by adding one block after the other to the distribution of the rank sums. They
// are kept sorted: treatments are exchangeable, which leaves few different ones.
std::optional<double> counted_p_value(const RankedBlocks& blocks) {
  constexpr std::size_t kMostTreatments = 6;
  constexpr std::size_t kMostWork = 4'000'000;  // sums times permutations, over all blocks
  if (blocks.treatments > kMostTreatments) return std::nullopt;
  std::map<TwiceRanks, double> distribution = {{TwiceRanks(blocks.treatments, 0), 1.0}};
  std::size_t work = 0;
  for (const TwiceRanks& ranks : blocks.ranks) {
    std::vector<TwiceRanks> permutations;  // the different ones, all equally likely
    TwiceRanks permutation = ranks;
    std::sort(permutation.begin(), permutation.end());
    do {
      permutations.push_back(permutation);
    } while (std::next_permutation(permutation.begin(), permutation.end()));
    work += distribution.size() * permutations.size();
    if (work > kMostWork) return std::nullopt;
    std::map<TwiceRanks, double> next;
    const double share = 1.0 / static_cast<double>(permutations.size());
    for (const auto& [sums, probability] : distribution) {
      for (const TwiceRanks& added : permutations) {
        TwiceRanks total = sums;
        for (std::size_t t = 0; t < total.size(); ++t) total[t] += added[t];
        std::sort(total.begin(), total.end());
        next[std::move(total)] += probability * share;
      }
    }
    distribution = std::move(next);
  }
  const std::int64_t observed = spread(blocks.sums, blocks.ranks.size());
  double tail = 0.0;
  for (const auto& [sums, probability] : distribution) {
    if (spread(sums, blocks.ranks.size()) >= observed) tail += probability;
  }
  return std::min(1.0, tail);
}

}  // namespace

Friedman friedman_test(std::span<const std::vector<double>> blocks) {
  Friedman result;
  result.treatments = require_blocks("friedman_test", blocks);
  result.blocks = blocks.size();
  const RankedBlocks ranks = ranked(blocks, result.treatments);
  const auto n = static_cast<double>(result.blocks);
  const auto k = static_cast<double>(result.treatments);
  for (const std::int64_t sum : ranks.sums) {
    result.mean_ranks.push_back(static_cast<double>(sum) / (2.0 * n));
  }
  result.degrees_of_freedom = k - 1.0;
  if (ranks.squares == 0) return result;
  // (k-1) Σ(R - mean)² / Σ(r - mean)²: without ties 12/(nk(k+1)) Σ(R - mean)².
  result.statistic = (k - 1.0) * static_cast<double>(spread(ranks.sums, result.blocks)) /
                     static_cast<double>(ranks.squares);
  result.p_value = chi_squared_upper_tail(result.statistic, result.degrees_of_freedom);
  result.kendalls_w = std::min(1.0, result.statistic / (n * (k - 1.0)));
  if (result.blocks > 1) {
    const double rest = n * (k - 1.0) - result.statistic;
    result.f_statistic =
        rest > 0.0 ? (n - 1.0) * result.statistic / rest : std::numeric_limits<double>::infinity();
    result.f_p_value = fisher_f_upper_tail(*result.f_statistic, k - 1.0, (k - 1.0) * (n - 1.0));
  }
  return result;
}

std::optional<double> friedman_exact_p_value(std::span<const std::vector<double>> blocks) {
  const std::size_t treatments = require_blocks("friedman_exact_p_value", blocks);
  return counted_p_value(ranked(blocks, treatments));
}

std::vector<PairwiseComparison> friedman_post_hoc(std::span<const std::vector<double>> blocks) {
  const std::size_t treatments = require_blocks("friedman_post_hoc", blocks);
  const RankedBlocks ranks = ranked(blocks, treatments);
  const auto n = static_cast<double>(blocks.size());
  const double variance = 2.0 * static_cast<double>(ranks.squares) /
                          (4.0 * static_cast<double>(treatments - 1) * n * n);
  std::vector<PairwiseComparison> comparisons;
  std::vector<double> p_values;
  for (std::size_t a = 0; a < treatments; ++a) {
    for (std::size_t b = a + 1; b < treatments; ++b) {
      PairwiseComparison comparison{a, b, 0.0, 1.0, 1.0};
      comparison.effect = static_cast<double>(ranks.sums[a] - ranks.sums[b]) / (2.0 * n);
      if (comparison.effect != 0.0) {
        const double z = std::abs(comparison.effect) / std::sqrt(variance);
        comparison.p_value = 2.0 * normal_upper_tail(z);
      }
      p_values.push_back(comparison.p_value);
      comparisons.push_back(comparison);
    }
  }
  const std::vector<double> adjusted = holm_adjusted(p_values);
  for (std::size_t i = 0; i < adjusted.size(); ++i) comparisons[i].adjusted = adjusted[i];
  return comparisons;
}

}  // namespace cairn
