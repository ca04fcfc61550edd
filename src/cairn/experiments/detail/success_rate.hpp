// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <map>
#include <span>

#include "cairn/experiments/study.hpp"

namespace cairn::detail {

/// Success rates with intervals of one confidence, within 0 and 1.
class RateEstimator {
 public:
  explicit RateEstimator(double confidence);

  /// Of independent trials, with the score interval of Wilson (1927).
  SuccessRate independent(SuccessCount count) const;

  /// Of trials in clusters of which the clusters are independent. Wilson's interval for as many independent trials as
  /// have the variance between the clusters (the trials over the design effect), fewer by (z / t)² for the few clusters
  /// that show it; each cluster counts as one trial if they do not vary: Korn and Graubard, "Confidence intervals for
  /// proportions with small expected number of positive counts estimated from survey data", Survey Methodology 24,
  /// 193-201 (1998), with Wilson's interval instead of the exact one (Franco et al., Journal of Survey Statistics and
  /// Methodology 7, 334-364, 2019).
  /// @param clusters those without trials count for nothing
  /// @return with the interval [0, 1] if fewer than two clusters have trials
  SuccessRate clustered(std::span<const SuccessCount> clusters);

 private:
  double confidence_;
  double z_;
  std::map<std::size_t, double> t_;  // by the number of clusters
};

}  // namespace cairn::detail
