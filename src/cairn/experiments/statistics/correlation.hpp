// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <optional>
#include <span>

#include "cairn/experiments/statistics/hypothesis.hpp"
#include "cairn/experiments/statistics/interval.hpp"

namespace cairn {

/// Pearson's correlation of pairs.
/// @param first,second finite, equally many
/// @return std::nullopt for fewer than two pairs, or if either is constant
/// @throws Error (misuse)
std::optional<double> pearson_correlation(std::span<const double> first,
                                          std::span<const double> second);

struct SpearmanOptions {
  double confidence = 0.95;  ///< within (0, 1)
  /// Of the two-sided p-value. kAutomatic and kExact count the permutations of up to 9 pairs, ties and
  /// all; kAutomatic approximates above that, kExact refuses.
  PValueMethod method = PValueMethod::kAutomatic;
};

struct Spearman {
  std::size_t pairs = 0;
  double rho = 0.0;  ///< in [-1, 1]
  /// std::nullopt for fewer than four pairs, or if rho is 1 or -1.
  std::optional<Interval> interval;
  double p_value = 1.0;  ///< two-sided, that the two are independent
  bool exact = false;    ///< whether `p_value` is exact
};

/// Spearman's rank correlation: Pearson's of the mid-ranks, right with ties; Hollander and Wolfe,
/// "Nonparametric Statistical Methods", 2nd ed. 1999, section 8.5. The interval is that of
/// atanh(rho) with the standard error sqrt((1 + rho²/2)/(n - 3)) of Bonett and Wright, "Sample size
/// requirements for estimating Pearson, Kendall and Spearman correlations", Psychometrika 65, 23-28
/// (2000). The p-value is exact or Student's of rho·sqrt((n - 2)/(1 - rho²)) with n - 2 degrees of
/// freedom.
/// @param first,second finite, equally many
/// @return std::nullopt for fewer than three pairs, or if either is constant
/// @throws Error (misuse)
std::optional<Spearman> spearman_correlation(std::span<const double> first,
                                             std::span<const double> second,
                                             const SpearmanOptions& options = {});

}  // namespace cairn
