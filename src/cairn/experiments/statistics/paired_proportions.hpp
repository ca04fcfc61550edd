// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "cairn/experiments/statistics/interval.hpp"
#include "cairn/experiments/statistics/proportion.hpp"

/// Two methods tried on the same cases, each succeeding or not. All functions assume independent pairs;
/// for clusters of pairs (many poses of one pair of maps) use clustered_success_difference().
namespace cairn {

/// Number of pairs by which of the two trials succeeded.
struct PairedCounts {
  std::size_t both = 0;
  std::size_t first_only = 0;
  std::size_t second_only = 0;
  std::size_t neither = 0;

  std::size_t pairs() const { return both + first_only + second_only + neither; }
  std::size_t discordant() const { return first_only + second_only; }
  SuccessCount first() const { return {both + first_only, pairs()}; }
  SuccessCount second() const { return {both + second_only, pairs()}; }
};

/// @param first,second whether each of the same cases succeeded
/// @throws Error (misuse) unless there are equally many
PairedCounts count_pairs(const std::vector<bool>& first, const std::vector<bool>& second);

/// McNemar's exact test, two-sided: given that pairs differ, either order is equally likely, so
/// p = min(1, 2·P(X <= min(b, c))) with X binomial(b + c, 1/2) and b, c the discordant counts.
/// McNemar, Psychometrika 12, 153-157 (1947). Conservative; see mcnemar_mid_p().
/// @return 1 if no pair differs
double mcnemar_exact(const PairedCounts& counts);

/// The exact test that counts the observed outcome with half its probability: not conservative.
/// Fagerland, Lydersen and Laake, "The McNemar test for binary matched-pairs data", BMC Medical
/// Research Methodology 13:91 (2013), recommend it over the others.
/// @return 1 if no pair differs
double mcnemar_mid_p(const PairedCounts& counts);

struct ChiSquaredTest {
  double statistic = 0.0;
  double degrees_of_freedom = 1.0;
  double p_value = 1.0;
};

/// McNemar's test by the chi-squared distribution: (|b - c| - 1)² / (b + c) with the continuity
/// correction of Edwards, Psychometrika 13, 185-187 (1948), and (b - c)² / (b + c) without. For large
/// numbers of discordant pairs; below some 25 prefer the exact test. As in R's mcnemar.test the
/// correction never exceeds |b - c|.
/// @return statistic 0 and p-value 1 if no pair differs
ChiSquaredTest mcnemar_chi_squared(const PairedCounts& counts, bool continuity_correction = true);

/// The difference of the success rates, first - second, with the interval of Newcombe, "Improved
/// confidence intervals for the difference between binomial proportions based on paired data",
/// Statistics in Medicine 17, 2635-2650 (1998), method 10: Wilson's intervals of the two rates, put
/// together with the correlation φ of the pairs, which is corrected for continuity if positive:
///   low = d - sqrt((p1 - l1)² - 2φ(p1 - l1)(u2 - p2) + (u2 - p2)²), high accordingly.
/// @return std::nullopt for no pairs
/// @throws Error (misuse)
std::optional<ProportionDifference> paired_difference(const PairedCounts& counts,
                                                      double confidence = 0.95);

/// The standardised deviation of the difference of the success rates from a hypothetical one, in
/// which the nuisance parameter takes its most likely value under the hypothesis: the score test of
/// Tango, "Equivalence test and confidence interval for the difference in proportions for the
/// paired-sample design", Statistics in Medicine 17, 891-908 (1998),
///   z = (b - c - nΔ) / sqrt(n(2q + Δ(1 - Δ))),
///   q = (B + sqrt(B² + 8ncΔ(1 - Δ))) / 4n, B = b + c - (2n - b + c)Δ.
/// At Δ = 0 its square is McNemar's statistic without correction.
/// @param hypothetical within (-1, 1)
/// @return standard normal if the hypothesis is true; infinite if it is impossible; std::nullopt for no
///         pairs
/// @throws Error (misuse)
std::optional<double> paired_score_statistic(const PairedCounts& counts, double hypothetical);

/// The difference of the success rates. The interval holds the differences that Tango's score test does
/// not reject (see paired_score_statistic), so it agrees with that test exactly; Newcombe's interval
/// differs little.
/// @return std::nullopt for no pairs
/// @throws Error (misuse)
std::optional<ProportionDifference> paired_score_difference(const PairedCounts& counts,
                                                            double confidence = 0.95);

/// How many times likelier it is that only the first succeeds than that only the second does.
struct DiscordantOdds {
  double ratio = 1.0;  ///< b/c; infinite if c = 0
  Interval interval;   ///< exact; `high` infinite if c = 0
};

/// The conditional odds ratio b/c of paired trials, whose exact interval is p/(1 - p) of Clopper and
/// Pearson's for p = b/(b + c): Breslow and Day, "Statistical Methods in Cancer Research I", 1980,
/// section 5.2.
/// @return std::nullopt if no pair differs
/// @throws Error (misuse)
std::optional<DiscordantOdds> discordant_odds(const PairedCounts& counts, double confidence = 0.95);

}  // namespace cairn
