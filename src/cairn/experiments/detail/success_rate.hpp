// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <map>
#include <span>

#include "cairn/experiments/study.hpp"

namespace cairn::detail {

/// Success rates with intervals of a given confidence, within 0 and 1.
class RateEstimator {
 public:
  explicit RateEstimator(double confidence);

  /// Rate of independent trials, with the score interval of Wilson (1927).
  SuccessRate independent(SuccessCount count) const;

  /// Rate of trials in clusters, where only the clusters are independent. Wilson's interval for an effective number of
  /// independent trials: as many as have the variance between the clusters (the trials over the design effect), reduced
  /// by the factor (z / t)² because only few clusters show this variance. If the clusters do not vary, each counts as
  /// one trial. Source: Korn and Graubard, "Confidence intervals for proportions with small expected number of positive
  /// counts estimated from survey data", Survey Methodology 24, 193-201 (1998), with Wilson's interval instead of the
  /// exact one (Franco et al., Journal of Survey Statistics and Methodology 7, 334-364, 2019).
  /// @param clusters clusters without trials are ignored
  /// @return rate with the interval [0, 1] if fewer than two clusters have trials
  SuccessRate clustered(std::span<const SuccessCount> clusters);

 private:
  double confidence_;
  double z_;
  std::map<std::size_t, double> t_;  // by the number of clusters
};

}  // namespace cairn::detail
