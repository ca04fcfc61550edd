// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <optional>
#include <span>

#include "cairn/experiments/statistics/interval.hpp"

/// Success rates and their uncertainty.
namespace cairn {

/// How often something succeeded.
struct SuccessCount {
  std::size_t successes = 0;
  std::size_t trials = 0;

  /// std::nullopt for no trials.
  std::optional<double> rate() const;
  /// @throws Error (misuse) for more successes than trials
  void validate() const;
};

/// The score interval of Wilson (1927), without continuity correction:
///   (p + z²/2n ± z·sqrt(p(1-p)/n + z²/4n²)) / (1 + z²/n).
/// Never leaves [0, 1] and never has zero width, not even with no or only successes. Recommended by
/// Newcombe, "Two-sided confidence intervals for the single proportion", Statistics in Medicine 17,
/// 857-872 (1998), method 3.
/// @param confidence within (0, 1)
/// @return [0, 1] for no trials
/// @throws Error (misuse)
Interval wilson_interval(SuccessCount count, double confidence = 0.95);

/// The exact interval of Clopper and Pearson (1934), from quantiles of the beta distribution: covers
/// at least as often as it says, hence is wider than Wilson's. Newcombe (1998), method 5.
/// @return [0, 1] for no trials
/// @throws Error (misuse)
Interval clopper_pearson_interval(SuccessCount count, double confidence = 0.95);

/// A success rate with its interval.
struct Proportion {
  SuccessCount count;
  std::optional<double> estimate;  ///< std::nullopt for no trials
  Interval interval;
};

/// Of independent trials, with Wilson's interval.
Proportion estimate_proportion(SuccessCount count, double confidence = 0.95);

/// Of trials in clusters, of which the clusters are independent, such as starts of places. Wilson's interval for as many
/// independent trials as have the variance between the clusters (the trials over the design effect), fewer by
/// (z / t)² for the few clusters that show it; each cluster counts as one trial if they do not vary: Korn and Graubard,
/// "Confidence intervals for proportions with small expected number of positive counts estimated from survey data",
/// Survey Methodology 24, 193-201 (1998), with Wilson's interval instead of the exact one (Franco et al., Journal of
/// Survey Statistics and Methodology 7, 334-364, 2019).
/// @param clusters those without trials count for nothing
/// @return with the interval [0, 1] if fewer than two clusters have trials
/// @throws Error (misuse)
Proportion clustered_proportion(std::span<const SuccessCount> clusters, double confidence = 0.95);

/// The difference of two success rates, first - second, with its interval.
struct ProportionDifference {
  double estimate = 0.0;
  Interval interval;
};

/// The difference of two independent success rates. The interval puts Wilson's for each together:
///   low = d - sqrt((p1 - l1)² + (u2 - p2)²), high = d + sqrt((u1 - p1)² + (p2 - l2)²);
/// Newcombe, "Interval estimation for the difference between independent proportions", Statistics in
/// Medicine 17, 873-890 (1998), method 10. Rates of the same trials are paired: paired_difference().
/// @return std::nullopt if either has no trials
/// @throws Error (misuse)
std::optional<ProportionDifference> independent_difference(SuccessCount first, SuccessCount second,
                                                           double confidence = 0.95);

/// Cohen's h, the difference of two proportions on a scale where its variance does not depend on
/// them: 2·asin(sqrt(p1)) - 2·asin(sqrt(p2)), within [-π, π]; about 0.2 is small, 0.5 medium, 0.8
/// large (Cohen, "Statistical Power Analysis for the Behavioral Sciences", 2nd ed. 1988, chapter 6).
/// @param first,second within [0, 1]
/// @throws Error (misuse)
double cohens_h(double first, double second);

}  // namespace cairn
