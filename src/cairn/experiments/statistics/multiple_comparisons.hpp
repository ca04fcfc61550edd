// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <span>
#include <vector>

/// Many tests at once, and tests of all pairs of treatments.
namespace cairn {

/// P-values adjusted by Holm's step-down procedure: if those of at most α are rejected, the probability
/// of rejecting any true hypothesis is at most α, however the tests depend on each other. The i-th
/// smallest of m becomes the largest of (m - j + 1)·p_(j) over j <= i, at most 1. Holm, "A simple
/// sequentially rejective multiple test procedure", Scandinavian Journal of Statistics 6, 65-70
/// (1979); Wright, Biometrics 48, 1005-1013 (1992).
/// @param p_values within [0, 1]
/// @return in the same order
/// @throws Error (misuse)
std::vector<double> holm_adjusted(std::span<const double> p_values);

/// Comparison of two of several treatments.
struct PairwiseComparison {
  std::size_t first = 0;   ///< index of a treatment
  std::size_t second = 0;  ///< index of the other; higher than `first`
  double effect = 0.0;     ///< of first against second; the function says which
  double p_value = 1.0;    ///< two-sided, of this comparison alone
  double adjusted = 1.0;   ///< holm_adjusted() among all comparisons
};

/// Wilcoxon's signed-rank test of each pair of treatments, adjusted by Holm's procedure. Benavoli,
/// Corani and Mangili, Journal of Machine Learning Research 17(5), 1-10 (2016), recommend it over the
/// comparison of mean ranks, whose result for a pair depends on the other treatments. `effect` is the
/// rank-biserial correlation, 0 if all are equal.
/// @param blocks a row per case, a column per treatment; finite, at least two columns
/// @throws Error (misuse)
std::vector<PairwiseComparison> pairwise_signed_rank(std::span<const std::vector<double>> blocks);

/// McNemar's exact test of each pair of treatments, adjusted by Holm's procedure. `effect` is the
/// difference of the success rates, 0 if there are no cases.
/// @param successes a row per treatment, at least two: whether it succeeded on each case
/// @throws Error (misuse)
std::vector<PairwiseComparison> pairwise_mcnemar(std::span<const std::vector<bool>> successes);

}  // namespace cairn
