// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <optional>
#include <span>

#include "cairn/experiments/statistics/interval.hpp"
#include "cairn/experiments/statistics/paired_proportions.hpp"

/// Whether two methods do the same up to a margin, for no significant difference does not tell: two
/// one-sided tests (TOST), Schuirmann, "A comparison of the two one-sided tests procedure and the power
/// approach for assessing the equivalence of average bioavailability", Journal of Pharmacokinetics and
/// Biopharmaceutics 15, 657-680 (1987). Equivalence at level α is shown if the interval of confidence
/// 1 - 2α, 90 % for α = 0.05, lies within the margin.
namespace cairn {

struct Equivalence {
  double estimate = 0.0;        ///< of the difference, first - second
  Interval margin;              ///< what differences count as none
  double alpha = 0.05;          ///< level of each test
  Interval interval;            ///< of confidence 1 - 2·alpha
  double statistic_low = 0.0;   ///< against the margin's lower end; large if above it
  double statistic_high = 0.0;  ///< against its upper end; very negative if below it
  double p_low = 1.0;           ///< that the difference is at or below the margin's lower end
  double p_high = 1.0;          ///< that it is at or above its upper end
  double p_value = 1.0;         ///< the larger of the two
  bool equivalent = false;      ///< whether p_value < alpha, hence the interval within the margin
};

/// What a paired t-test needs to know of the differences.
struct DifferenceSummary {
  std::size_t count = 0;
  double mean = 0.0;
  double standard_deviation = 0.0;  ///< over count - 1
};

/// TOST of the mean of paired differences by Student's distribution with n - 1 degrees of freedom:
/// t = (mean - margin)·sqrt(n)/s. Lakens, "Equivalence tests: a practical primer for t tests,
/// correlations, and meta-analyses", Social Psychological and Personality Science 8, 355-362 (2017).
/// Without any variance the p-values are 0 or 1: whether the mean lies within the margin.
/// @param margin of the differences' unit, low < high
/// @param alpha within (0, 0.5)
/// @return std::nullopt for fewer than two differences
/// @throws Error (misuse)
std::optional<Equivalence> tost_paired_means(const DifferenceSummary& differences, Interval margin,
                                             double alpha = 0.05);

/// The same of the differences themselves, first - second, finite.
std::optional<Equivalence> tost_paired_means(std::span<const double> differences, Interval margin,
                                             double alpha = 0.05);

/// TOST of the difference of the success rates of paired trials by Tango's score test, which holds its
/// level with few discordant pairs, even none, where the usual one does not: see
/// paired_score_statistic(). The interval is paired_score_difference()'s.
/// @param margin within (0, 1): differences from -margin to margin count as none
/// @param alpha within (0, 0.5)
/// @return std::nullopt for no pairs
/// @throws Error (misuse)
std::optional<Equivalence> tost_paired_proportions(const PairedCounts& counts, double margin,
                                                   double alpha = 0.05);

}  // namespace cairn
