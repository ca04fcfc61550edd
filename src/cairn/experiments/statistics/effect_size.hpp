// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <span>

#include "cairn/experiments/statistics/interval.hpp"

/// How large a difference is, whatever the number of measurements. For proportions see cohens_h() and
/// discordant_odds(), for paired ranks SignedRank::rank_biserial.
namespace cairn {

/// Cohen's d of paired measurements: the mean of the differences over their standard deviation (over
/// n - 1); Cohen, "Statistical Power Analysis for the Behavioral Sciences", 2nd ed. 1988, section 2.3;
/// Lakens, Frontiers in Psychology 4:863 (2013), equation 6.
/// @param differences first - second, finite
/// @return std::nullopt for fewer than two, or if all are equal
/// @throws Error (misuse)
std::optional<double> cohens_dz(std::span<const double> differences);

/// How far one group of values lies above another.
struct Dominance {
  double delta = 0.0;  ///< Cliff's: P(first > second) - P(first < second), in [-1, 1]
  /// Of delta; std::nullopt with fewer than two values in either group. Of zero width, and therefore without
  /// information, if the groups do not overlap.
  std::optional<Interval> interval;
  /// Vargha and Delaney's A: P(first > second) + P(first = second)/2 = (delta + 1)/2.
  double vargha_delaney_a = 0.5;
};

/// Cliff's delta of two independent groups with its asymmetric interval, from the unbiased variance
/// and Student's distribution with n1 + n2 - 2 degrees of freedom:
///   (δ - δ³ ± t·s·sqrt((1 - δ²)² + t²s²)) / (1 - δ² + t²s²);
/// Cliff, "Ordinal Methods for Behavioral Data Analysis", 1996; Feng and Cliff, Journal of Modern
/// Applied Statistical Methods 3, 322-332 (2004). A: Vargha and Delaney, Journal of Educational and
/// Behavioral Statistics 25, 101-132 (2000). A variance estimated below (1 - δ²)/(n1·n2 - 1) is raised
/// to that, as Cliff advises.
/// @param first,second finite
/// @return std::nullopt if either group is empty
/// @throws Error (misuse)
std::optional<Dominance> cliffs_delta(std::span<const double> first, std::span<const double> second,
                                      double confidence = 0.95);

}  // namespace cairn
