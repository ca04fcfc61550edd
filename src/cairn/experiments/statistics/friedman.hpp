// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "cairn/experiments/statistics/multiple_comparisons.hpp"

/// Several treatments (methods) measured on the same blocks (cases). Blocks are rows with one value a
/// treatment; the lowest value of a block has rank 1.
namespace cairn {

struct Friedman {
  std::size_t blocks = 0;
  std::size_t treatments = 0;
  std::vector<double> mean_ranks;  ///< one per treatment; 1 is lowest
  double statistic = 0.0;          ///< chi-squared with treatments - 1 degrees, corrected for ties
  double degrees_of_freedom = 0.0;
  double p_value = 1.0;  ///< by the chi-squared distribution
  /// The F statistic of Iman and Davenport (1980), less conservative: (n-1)χ² / (n(k-1) - χ²) with k-1
  /// and (k-1)(n-1) degrees. Infinite if all blocks agree; std::nullopt for one block or if all are tied.
  std::optional<double> f_statistic;
  std::optional<double> f_p_value;
  /// Kendall's W, agreement of the blocks, 0 (none) to 1: statistic / n(k-1). std::nullopt if all is tied.
  std::optional<double> kendalls_w;
};

/// Friedman's rank sum test that treatments do not differ, corrected for ties: Hollander and Wolfe,
/// "Nonparametric Statistical Methods", 2nd ed. 1999, section 7.1; with the notes of Demšar,
/// "Statistical comparisons of classifiers over multiple data sets", Journal of Machine Learning
/// Research 7, 1-30 (2006). Of successes (1) and failures (0) it is Cochran's Q test.
/// @throws Error (misuse); of no blocks, blocks of different lengths, fewer than
///         two treatments or values that are not finite
Friedman friedman_test(std::span<const std::vector<double>> blocks);

/// The exact p-value of the same test: the share of the assignments of ranks within blocks, all equally
/// likely and ties as they are, whose statistic is no less. Takes up to some seconds; worth it with
/// few blocks, where the chi-squared distribution is far off.
/// @return std::nullopt if there are too many to count: above 6 treatments, some hundred blocks of 3 or
///         some twenty of 4
/// @throws Error (misuse) as friedman_test() does
std::optional<double> friedman_exact_p_value(std::span<const std::vector<double>> blocks);

/// Which treatments differ: the difference of the mean ranks of each pair over its standard deviation
/// under the null hypothesis, taken as normal (Demšar 2006, section 3.2.2), with p-values adjusted by
/// Holm's procedure. The variance is that of the ranks as they are: k(k+1)/6n without ties, the mean
/// over the blocks of 2Σ(r - (k+1)/2)²/(k-1), over n, with them. `effect` is the difference of the mean
/// ranks.
/// @throws Error (misuse); of no blocks, blocks of different lengths, fewer than
///         two treatments or values that are not finite
std::vector<PairwiseComparison> friedman_post_hoc(std::span<const std::vector<double>> blocks);

}  // namespace cairn
