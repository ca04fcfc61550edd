// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <stop_token>
#include <vector>

#include "cairn/core/executor.hpp"
#include "cairn/experiments/statistics/interval.hpp"

/// Confidence intervals of any statistic by resampling with replacement: Efron and Tibshirani, "An
/// Introduction to the Bootstrap", 1993, chapters 13 and 14; Davison and Hinkley, "Bootstrap Methods
/// and their Application", 1997.
///
/// What is resampled has to be independent. Two hundred poses of one pair of maps are not: they share
/// the maps. Then the pairs of maps (clusters) are resampled, each with all that belongs to it.
namespace cairn {

struct BootstrapOptions {
  std::size_t resamples = 10'000;  ///< at least 2; intervals want some thousands
  double confidence = 0.95;        ///< within (0, 1)
  std::uint64_t seed = 0;
  Executor executor = Executor();  ///< the result is the same for any number of threads
  std::stop_token stop = {};       ///< when asked, Error (cancelled)

  /// @throws Error (misuse) naming the field
  void validate() const;
};

struct BootstrapResult {
  double estimate = 0.0;        ///< of the data themselves
  double standard_error = 0.0;  ///< deviation of the resampled statistic, over resamples - 1
  double bias = 0.0;            ///< mean of the resampled statistic less the estimate
  /// Between the quantiles of the resampled statistic. Of no width if no resample varies it, which
  /// tells of too little variation in the data, not of certainty. std::nullopt if it was never defined.
  std::optional<Interval> percentile;
  /// Bias-corrected and accelerated: between quantiles shifted for the bias of the median and for the
  /// change of the standard error with the statistic; its coverage is an order more accurate. Prefer
  /// it. std::nullopt if that cannot be estimated: the statistic undefined without one of the units, or
  /// (nearly) all of the resamples on one side of the estimate.
  std::optional<Interval> bca;
  double bias_correction =
      0.0;  ///< z0: normal quantile of the resamples below the estimate, ties half
  double acceleration = 0.0;  ///< a: a sixth of the skewness of the jackknife values
  std::size_t undefined = 0;  ///< resamples whose statistic was not finite, left out
};

/// A number that sums up values. Called from several threads at once. NaN where undefined.
using Statistic = std::function<double(std::span<const double>)>;
/// One that sums up pairs of values, such as a correlation.
using PairedStatistic =
    std::function<double(std::span<const double> first, std::span<const double> second)>;
/// One that sums up units known by their indices, of which a resample holds some more than once.
using UnitStatistic = std::function<double(std::span<const std::size_t> units)>;

/// Intervals of a statistic of independent values.
/// @param values at least one, finite
/// @throws Error (misuse), also if the statistic of the values is not finite; (cancelled)
BootstrapResult bootstrap(std::span<const double> values, const Statistic& statistic,
                          const BootstrapOptions& options = {});

/// Intervals of a statistic of independent pairs, which stay together.
/// @throws Error as bootstrap() does, and for different numbers of values
BootstrapResult bootstrap_pairs(std::span<const double> first, std::span<const double> second,
                                const PairedStatistic& statistic,
                                const BootstrapOptions& options = {});

/// Intervals of a statistic of anything: the general form of the others.
/// @param units how many there are, at least one
/// @throws Error as bootstrap() does
BootstrapResult bootstrap_units(std::size_t units, const UnitStatistic& statistic,
                                const BootstrapOptions& options = {});

/// What is drawn of a cluster that was drawn.
enum class ClusterResampling {
  /// All of it, as it is. The usual choice: the clusters' own variation already holds that within them
  /// (Davison and Hinkley, section 3.8; Field and Welsh, Journal of the Royal Statistical Society B
  /// 69, 369-390, 2007).
  kWhole,
  /// As many as it has, with replacement. Wider; counts the variation within clusters twice unless the
  /// clusters are large.
  kTwoStage,
};

/// Intervals of a statistic of values in clusters, of which the clusters are independent. The
/// statistic sees the values of all clusters drawn, one cluster after the other; the jackknife of the
/// acceleration leaves out whole clusters.
/// @param clusters at least one with values; finite
/// @throws Error as bootstrap() does
BootstrapResult bootstrap_clusters(std::span<const std::vector<double>> clusters,
                                   const Statistic& statistic, const BootstrapOptions& options = {},
                                   ClusterResampling resampling = ClusterResampling::kWhole);

/// Two methods tried on the same case, which belongs to a cluster such as a pair of maps.
struct PairedTrial {
  std::uint64_t cluster = 0;  ///< any number; the same for cases that are not independent
  bool first = false;         ///< whether the first method succeeded
  bool second = false;        ///< whether the second did
};

struct ClusteredDifference {
  std::size_t clusters = 0;
  std::size_t trials = 0;
  double first_rate = 0.0;     ///< of all trials, each counting the same
  double second_rate = 0.0;    ///< the same
  BootstrapResult difference;  ///< first_rate - second_rate
};

/// The difference of the success rates of two methods with intervals from resampling the clusters.
/// With few clusters (below some 20) these are too narrow; say how many there were.
/// @param trials at least one; their order within a cluster matters to kTwoStage only
/// @throws Error as bootstrap() does
ClusteredDifference clustered_success_difference(
    std::span<const PairedTrial> trials, const BootstrapOptions& options = {},
    ClusterResampling resampling = ClusterResampling::kWhole);

}  // namespace cairn
