// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/experiments/statistics/bootstrap.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>
#include <utility>

#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/core/random.hpp"
#include "cairn/core/statistics.hpp"
#include "cairn/experiments/statistics/distributions.hpp"
#include "cairn/experiments/statistics/moments.hpp"
#include "cairn/experiments/statistics/validation.hpp"

namespace cairn {
namespace {

// The parts in which the kinds of bootstrap differ.
struct Resampler {
  double estimate = 0.0;
  std::size_t units = 0;                           // independent ones, for the jackknife
  std::function<double(Random&)> resample;         // the statistic of a resample
  std::function<double(std::size_t)> without_one;  // the statistic without one unit
};

std::vector<double> computed(std::size_t count, const BootstrapOptions& options,
                             const std::function<double(std::size_t)>& value) {
  constexpr std::size_t kBlock = 64;
  std::vector<double> values(count);
  options.executor.for_blocks(count, kBlock, [&](std::size_t begin, std::size_t end) {
    if (options.stop.stop_requested()) {
      throw Error(ErrorKind::kCancelled, "bootstrap", "asked to stop", "");
    }
    for (std::size_t i = begin; i < end; ++i) values[i] = value(i);
  });
  return values;
}

// z0 of Efron and Tibshirani, equation 14.14, with half of what equals the estimate: statistics of
// counts often do.
double share_below(const std::vector<double>& replicates, double estimate) {
  double below = 0.0;
  for (const double value : replicates) {
    if (value < estimate) {
      below += 1.0;
    } else if (value == estimate) {
      below += 0.5;
    }
  }
  return below / static_cast<double>(replicates.size());
}

// a of their equation 14.15; NaN if the statistic is undefined without one of the units.
double jackknife_acceleration(const std::vector<double>& values) {
  if (values.size() < 2) return std::numeric_limits<double>::quiet_NaN();
  const double mean = *sample_mean(values);
  double squares = 0.0;
  double cubes = 0.0;
  for (const double value : values) {
    const double deviation = mean - value;
    squares += deviation * deviation;
    cubes += deviation * deviation * deviation;
  }
  return squares == 0.0 ? 0.0 : cubes / (6.0 * squares * std::sqrt(squares));
}

std::optional<Interval> bca_interval(const std::vector<double>& replicates, double z0, double a,
                                     double confidence) {
  if (!std::isfinite(z0) || !std::isfinite(a)) return std::nullopt;
  const double z = normal_two_sided_quantile(confidence);
  const auto share = [&](double quantile) {
    const double shifted = z0 + quantile;
    const double slope = 1.0 - a * shifted;
    return slope > 0.0 ? normal_cdf(z0 + shifted / slope)
                       : std::numeric_limits<double>::quiet_NaN();
  };
  const double low = share(-z);
  const double high = share(z);
  if (std::isnan(low) || std::isnan(high)) return std::nullopt;
  return Interval{quantile(replicates, low), quantile(replicates, high)};
}

BootstrapResult run(const Resampler& resampler, const BootstrapOptions& options) {
  if (!std::isfinite(resampler.estimate)) {
    throw Error(ErrorKind::kMisuse, "bootstrap",
                fmt::format("the statistic of the data is {}", resampler.estimate),
                "a statistic that is finite for the data");
  }
  const Random random(options.seed);
  // A generator each, so that no resample depends on which thread drew the others.
  std::vector<double> replicates = computed(options.resamples, options, [&](std::size_t i) {
    Random own = random.fork(i);
    return resampler.resample(own);
  });
  BootstrapResult result;
  result.estimate = resampler.estimate;
  result.undefined = std::erase_if(replicates, [](double value) { return !std::isfinite(value); });
  if (replicates.empty()) return result;
  result.standard_error = sample_deviation(replicates).value_or(0.0);
  result.bias = *sample_mean(replicates) - resampler.estimate;
  const double tail = (1.0 - options.confidence) / 2.0;
  result.percentile = Interval{quantile(replicates, tail), quantile(replicates, 1.0 - tail)};

  const double below = share_below(replicates, resampler.estimate);
  const double acceleration =
      jackknife_acceleration(computed(resampler.units, options, resampler.without_one));
  if (below > 0.0 && below < 1.0 && std::isfinite(acceleration)) {
    result.bias_correction = normal_quantile(below);
    result.acceleration = acceleration;
    result.bca = bca_interval(replicates, result.bias_correction, acceleration, options.confidence);
  }
  return result;
}

void require_units(std::size_t units) {
  if (units == 0) throw Error(ErrorKind::kMisuse, "bootstrap", "no data", "at least one value");
}

std::vector<std::size_t> drawn(std::size_t count, Random& random) {
  std::vector<std::size_t> units(count);
  for (std::size_t& unit : units) unit = random.index(count);
  return units;
}

std::vector<std::size_t> all_but(std::size_t count, std::size_t left_out) {
  std::vector<std::size_t> units;
  units.reserve(count);
  for (std::size_t i = 0; i < count; ++i) {
    if (i != left_out) units.push_back(i);
  }
  return units;
}

std::vector<double> picked(std::span<const double> values, std::span<const std::size_t> places) {
  std::vector<double> result;
  result.reserve(places.size());
  for (const std::size_t place : places) result.push_back(values[place]);
  return result;
}

// Successes of the two methods in some trials.
struct Tally {
  std::size_t trials = 0;
  std::size_t first = 0;
  std::size_t second = 0;

  void add(const Tally& other) {
    trials += other.trials;
    first += other.first;
    second += other.second;
  }
  void add(const PairedTrial& trial) {
    add(Tally{1, trial.first ? 1U : 0U, trial.second ? 1U : 0U});
  }
  // Whole numbers, so that equal differences are equal to the last bit.
  double difference() const {
    const auto gain = static_cast<double>(first) - static_cast<double>(second);
    return trials == 0 ? std::numeric_limits<double>::quiet_NaN()
                       : gain / static_cast<double>(trials);
  }
};

}  // namespace

void BootstrapOptions::validate() const {
  if (resamples < 2) {
    throw Error(ErrorKind::kMisuse, "BootstrapOptions.resamples", fmt::format("{}", resamples),
                "at least 2");
  }
  require_confidence("BootstrapOptions.confidence", confidence);
}

BootstrapResult bootstrap_units(std::size_t units, const UnitStatistic& statistic,
                                const BootstrapOptions& options) {
  options.validate();
  require_units(units);
  std::vector<std::size_t> all(units);
  std::iota(all.begin(), all.end(), std::size_t{0});
  Resampler resampler;
  resampler.estimate = statistic(all);
  resampler.units = units;
  resampler.resample = [&](Random& random) { return statistic(drawn(units, random)); };
  resampler.without_one = [&](std::size_t i) { return statistic(all_but(units, i)); };
  return run(resampler, options);
}

BootstrapResult bootstrap(std::span<const double> values, const Statistic& statistic,
                          const BootstrapOptions& options) {
  require_finite("bootstrap", values);
  return bootstrap_units(
      values.size(),
      [&](std::span<const std::size_t> units) { return statistic(picked(values, units)); },
      options);
}

BootstrapResult bootstrap_pairs(std::span<const double> first, std::span<const double> second,
                                const PairedStatistic& statistic, const BootstrapOptions& options) {
  require_pairs("bootstrap_pairs", first.size(), second.size());
  require_finite("bootstrap_pairs, first", first);
  require_finite("bootstrap_pairs, second", second);
  return bootstrap_units(
      first.size(),
      [&](std::span<const std::size_t> units) {
        return statistic(picked(first, units), picked(second, units));
      },
      options);
}

BootstrapResult bootstrap_clusters(std::span<const std::vector<double>> clusters,
                                   const Statistic& statistic, const BootstrapOptions& options,
                                   ClusterResampling resampling) {
  options.validate();
  std::size_t values = 0;
  for (const std::vector<double>& cluster : clusters) {
    require_finite("bootstrap_clusters", cluster);
    values += cluster.size();
  }
  require_units(values);
  // Clusters of different sizes change the number of values, so that a resample may even have none.
  const auto pooled = [&](std::span<const std::size_t> chosen) {
    std::vector<double> pool;
    for (const std::size_t i : chosen) {
      pool.insert(pool.end(), clusters[i].begin(), clusters[i].end());
    }
    return pool;
  };
  const auto defined = [&](const std::vector<double>& pool) {
    return pool.empty() ? std::numeric_limits<double>::quiet_NaN() : statistic(pool);
  };
  Resampler resampler;
  std::vector<std::size_t> all(clusters.size());
  std::iota(all.begin(), all.end(), std::size_t{0});
  resampler.estimate = defined(pooled(all));
  resampler.units = clusters.size();
  resampler.without_one = [&](std::size_t i) {
    return defined(pooled(all_but(clusters.size(), i)));
  };
  resampler.resample = [&](Random& random) {
    const std::vector<std::size_t> chosen = drawn(clusters.size(), random);
    if (resampling == ClusterResampling::kWhole) return defined(pooled(chosen));
    std::vector<double> pool;
    for (const std::size_t i : chosen) {
      for (const std::size_t place : drawn(clusters[i].size(), random)) {
        pool.push_back(clusters[i][place]);
      }
    }
    return defined(pool);
  };
  return run(resampler, options);
}

ClusteredDifference clustered_success_difference(std::span<const PairedTrial> trials,
                                                 const BootstrapOptions& options,
                                                 ClusterResampling resampling) {
  options.validate();
  require_units(trials.size());
  std::map<std::uint64_t, std::vector<PairedTrial>> by_cluster;
  for (const PairedTrial& trial : trials) by_cluster[trial.cluster].push_back(trial);
  std::vector<std::vector<PairedTrial>> clusters;
  std::vector<Tally> tallies;
  Tally total;
  for (auto& [cluster, members] : by_cluster) {
    Tally tally;
    for (const PairedTrial& trial : members) tally.add(trial);
    total.add(tally);
    tallies.push_back(tally);
    clusters.push_back(std::move(members));
  }
  ClusteredDifference result;
  result.clusters = clusters.size();
  result.trials = trials.size();
  result.first_rate = static_cast<double>(total.first) / static_cast<double>(total.trials);
  result.second_rate = static_cast<double>(total.second) / static_cast<double>(total.trials);

  Resampler resampler;
  resampler.estimate = total.difference();
  resampler.units = clusters.size();
  resampler.without_one = [&](std::size_t left_out) {
    Tally rest;
    for (std::size_t i = 0; i < tallies.size(); ++i) {
      if (i != left_out) rest.add(tallies[i]);
    }
    return rest.difference();
  };
  resampler.resample = [&](Random& random) {
    Tally sum;
    for (const std::size_t i : drawn(clusters.size(), random)) {
      if (resampling == ClusterResampling::kWhole) {
        sum.add(tallies[i]);
      } else {
        for (const std::size_t place : drawn(clusters[i].size(), random)) {
          sum.add(clusters[i][place]);
        }
      }
    }
    return sum.difference();
  };
  result.difference = run(resampler, options);
  return result;
}

}  // namespace cairn
