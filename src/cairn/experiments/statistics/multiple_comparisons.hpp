// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <span>
#include <vector>

/// Many tests at once, and tests of all pairs of treatments.
namespace cairn {

/// P-values adjusted by Holm's step-down procedure: rejecting those at most α errs on any true
/// hypothesis with a probability of at most α, however the tests depend on each other. The i-th
/// smallest of m becomes the largest of (m - j + 1)·p_(j) over j <= i, at most 1. Holm, "A simple
/// sequentially rejective multiple test procedure", Scandinavian Journal of Statistics 6, 65-70
/// (1979); Wright, Biometrics 48, 1005-1013 (1992).
/// @param p_values within [0, 1]
/// @return in the same order
/// @throws Error (misuse)
std::vector<double> holm_adjusted(std::span<const double> p_values);

/// Two of several treatments compared.
struct PairwiseComparison {
  std::size_t first = 0;   ///< index of a treatment
  std::size_t second = 0;  ///< index of another, higher
  double effect = 0.0;     ///< of first against second; the function says which
  double p_value = 1.0;    ///< two-sided, of this comparison alone
  double adjusted = 1.0;   ///< holm_adjusted() among all comparisons
};

/// Wilcoxon's signed-rank test of each two treatments, adjusted by Holm's procedure. Recommended over
/// the comparison of mean ranks, which depends on the treatments that are not compared, by Benavoli,
/// Corani and Mangili, Journal of Machine Learning Research 17(5), 1-10 (2016). `effect` is the
/// rank-biserial correlation, 0 if all are equal.
/// @param blocks a row a case, a column a treatment; finite, at least two columns
/// @throws Error (misuse)
std::vector<PairwiseComparison> pairwise_signed_rank(std::span<const std::vector<double>> blocks);

/// McNemar's exact test of each two treatments, adjusted by Holm's procedure. `effect` is the
/// difference of the success rates, 0 of no cases.
/// @param successes a row per treatment, at least two: whether it succeeded on each case
/// @throws Error (misuse)
std::vector<PairwiseComparison> pairwise_mcnemar(std::span<const std::vector<bool>> successes);

}  // namespace cairn
