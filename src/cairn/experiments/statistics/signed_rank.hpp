// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <optional>
#include <span>

#include "cairn/experiments/statistics/hypothesis.hpp"
#include "cairn/experiments/statistics/interval.hpp"

/// Paired measurements without a normal distribution: Wilcoxon's signed ranks.
namespace cairn {

struct SignedRankOptions {
  Alternative alternative = Alternative::kTwoSided;
  /// kAutomatic is exact with at most 50 differences that are not 0 and whose sizes are all
  /// different. kExact takes ties as they are, with at most 500.
  PValueMethod method = PValueMethod::kAutomatic;
  bool continuity_correction = true;  ///< of the approximation: half a rank towards the mean
};

struct SignedRank {
  std::size_t used = 0;            ///< differences other than 0
  std::size_t zeros = 0;           ///< differences of 0, left out
  bool ties = false;               ///< whether sizes were equal
  double positive_rank_sum = 0.0;  ///< of the positive differences; R's V, elsewhere W+ or T+
  double negative_rank_sum = 0.0;
  double p_value = 1.0;
  bool exact = true;        ///< whether `p_value` is exact
  std::optional<double> z;  ///< standard normal; std::nullopt if exact
  /// Share of the rank sum of positive differences minus that of negative ones, in [-1, 1]: matched-pairs
  /// rank-biserial correlation (Kerby, "The simple difference formula", Comprehensive Psychology 3,
  /// 2014). std::nullopt if all are equal.
  std::optional<double> rank_biserial;
};

/// Wilcoxon's signed-rank test of differences that are symmetric about 0 under the null hypothesis;
/// Hollander and Wolfe, "Nonparametric Statistical Methods", 2nd ed. 1999, section 3.1. Differences
/// of 0 are left out before ranking, as by Wilcoxon and R (Pratt ranks them first). The exact p-value
/// counts the assignments of signs to the ranks; the two-sided one is twice the smaller tail, at most 1.
/// The approximation is normal with variance n(n+1)(2n+1)/24 - Σ(t³ - t)/48 over groups of t tied ranks.
/// @param differences first - second, finite
/// @return p-value 1 if all differences are 0
/// @throws Error (misuse)
SignedRank wilcoxon_signed_rank(std::span<const double> differences,
                                const SignedRankOptions& options = {});

/// How far paired measurements lie apart.
struct LocationShift {
  double estimate = 0.0;  ///< unit of the differences
  Interval interval;
  double confidence = 0.0;  ///< of the interval; see hodges_lehmann()
};

/// The Hodges-Lehmann estimate that goes with the signed-rank test, and Tukey's interval; Hollander and
/// Wolfe, sections 3.2 and 3.3. The estimate is the median of the Walsh averages: the means of all
/// pairs of differences, including each difference with itself. The interval lies between two of these
/// averages. Differences of 0 count.
///
/// With up to 50 differences and no ties the confidence is exact: the smallest attainable one that is
/// at least `confidence`. If none is, the interval is the range of the averages; the result states its
/// confidence. With more than 50 it is approximate. Memory grows with the square of the number of
/// differences.
/// @param differences finite
/// @return std::nullopt for no differences
/// @throws Error (misuse), also for more than 10 000 differences
std::optional<LocationShift> hodges_lehmann(std::span<const double> differences,
                                            double confidence = 0.95);

}  // namespace cairn
