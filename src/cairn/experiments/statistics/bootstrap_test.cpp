// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/experiments/statistics/bootstrap.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <stop_token>
#include <vector>

#include <gtest/gtest.h>

#include "cairn/core/error.hpp"
#include "cairn/core/random.hpp"
#include "cairn/core/statistics.hpp"
#include "cairn/experiments/statistics/correlation.hpp"
#include "cairn/experiments/statistics/moments.hpp"

namespace cairn {
namespace {

double mean_of(std::span<const double> values) {
  return *sample_mean(values);
}

double correlation_of(std::span<const double> x, std::span<const double> y) {
  return pearson_correlation(x, y).value_or(std::numeric_limits<double>::quiet_NaN());
}

bool same(const BootstrapResult& a, const BootstrapResult& b) {
  return a.estimate == b.estimate && a.standard_error == b.standard_error && a.bias == b.bias &&
         a.percentile->low == b.percentile->low && a.percentile->high == b.percentile->high &&
         a.bca->low == b.bca->low && a.bca->high == b.bca->high;
}

// Spatial ability of 26 children, test A: Efron and Tibshirani (1993), table 14.1. The variance over n
// is 171.5; its 90 % intervals are 100.8 to 233.9 (percentile) and 115.8 to 259.6 (BCa), with
// z0 = 0.146 and a = 0.061 (table 14.2 and section 14.3, from 2000 resamples).
TEST(Bootstrap, AgreesWithEfronAndTibshirani) {
  const std::vector<double> spatial = {48, 36, 20, 29, 42, 42, 20, 42, 22, 41, 45, 14, 6,
                                       0,  33, 28, 34, 4,  32, 24, 47, 41, 24, 26, 30, 41};
  const auto variance = [](std::span<const double> values) {
    const double deviation = *sample_deviation(values);
    const auto n = static_cast<double>(values.size());
    return deviation * deviation * (n - 1.0) / n;
  };
  const BootstrapResult result =
      bootstrap(spatial, variance, {.resamples = 20'000, .confidence = 0.9, .seed = 1});
  EXPECT_NEAR(result.estimate, 171.5, 0.05);
  EXPECT_NEAR(result.acceleration, 0.061, 5e-4) << "no Monte Carlo in it";
  // Tolerances of three standard errors of their 2000 resamples.
  EXPECT_NEAR(result.bias_correction, 0.146, 0.085);
  EXPECT_NEAR(result.percentile->low, 100.8, 6.0);
  EXPECT_NEAR(result.percentile->high, 233.9, 6.0);
  EXPECT_NEAR(result.bca->low, 115.8, 8.0);
  EXPECT_NEAR(result.bca->high, 259.6, 10.0);
}

// The law school data of the same book (table 3.1): the correlation of LSAT and GPA is 0.776, its
// bootstrap standard error 0.132 from 3200 resamples (table 6.1).
TEST(Bootstrap, KeepsPairsTogether) {
  const std::vector<double> lsat = {576, 635, 558, 578, 666, 580, 555, 661,
                                    651, 605, 653, 575, 545, 572, 594};
  const std::vector<double> gpa = {3.39, 3.30, 2.81, 3.03, 3.44, 3.07, 3.00, 3.43,
                                   3.36, 3.13, 3.12, 2.74, 2.76, 2.88, 2.96};
  const BootstrapResult result = bootstrap_pairs(lsat, gpa, correlation_of, {.seed = 2});
  EXPECT_NEAR(result.estimate, 0.776, 5e-4);
  EXPECT_NEAR(result.standard_error, 0.132, 0.006);
  EXPECT_LT(result.bca->high, 1.0);
  EXPECT_THROW(bootstrap_pairs(lsat, {}, correlation_of), Error);
}

// The bootstrap of the mean has no secrets: its standard error is sqrt(Σ(x - mean)²)/n, its bias 0.
TEST(Bootstrap, OfTheMeanHasTheKnownError) {
  const std::vector<double> values = {1.0, 2.0, 4.0, 8.0, 16.0, 3.0, 5.0};
  const BootstrapResult result = bootstrap(values, mean_of, {.resamples = 40'000, .seed = 3});
  const double n = 7.0;
  const double exact = *sample_deviation(values) * std::sqrt((n - 1.0) / n) / std::sqrt(n);
  EXPECT_NEAR(result.standard_error, exact, 0.02 * exact);
  EXPECT_NEAR(result.bias, 0.0, 0.02 * exact);
  // a by hand: a sixth of the skewness Σd³/(Σd²)^(3/2), which the jackknife of the mean gives exactly.
  double squares = 0.0;
  double cubes = 0.0;
  for (const double x : values) {
    const double d = x - mean_of(values);
    squares += d * d;
    cubes += d * d * d;
  }
  EXPECT_NEAR(result.acceleration, cubes / (6.0 * std::pow(squares, 1.5)), 1e-12);
}

TEST(Bootstrap, IsTheSameWithAnyNumberOfThreads) {
  Random random(4);
  std::vector<double> values(50);
  for (double& value : values) value = random.normal();
  const BootstrapOptions one{.resamples = 2000, .seed = 9};
  const BootstrapOptions many{.resamples = 2000, .seed = 9, .executor = Executor(0)};
  EXPECT_TRUE(same(bootstrap(values, mean_of, one), bootstrap(values, mean_of, many)));
  const std::vector<std::vector<double>> clusters = {{1, 2}, {3}, {2, 5, 7}, {4}, {0, 1}};
  EXPECT_TRUE(same(bootstrap_clusters(clusters, mean_of, one, ClusterResampling::kTwoStage),
                   bootstrap_clusters(clusters, mean_of, many, ClusterResampling::kTwoStage)));
  EXPECT_FALSE(same(bootstrap(values, mean_of, one),
                    bootstrap(values, mean_of, {.resamples = 2000, .seed = 10})));
}

TEST(Bootstrap, TakesConstantDataAndOneValue) {
  const BootstrapResult constant = bootstrap(std::vector<double>(10, 1.0), mean_of);
  EXPECT_EQ(constant.standard_error, 0.0);
  EXPECT_EQ(constant.bca->low, 1.0);
  EXPECT_EQ(constant.bca->high, 1.0);
  const BootstrapResult one = bootstrap(std::vector<double>{2.0}, mean_of);
  EXPECT_EQ(one.percentile->width(), 0.0);
  EXPECT_FALSE(one.bca) << "no jackknife of one value";
}

TEST(Bootstrap, LeavesUndefinedResamplesOut) {
  // A resample of equal values has no correlation.
  const BootstrapResult result =
      bootstrap_pairs(std::vector<double>{1, 2, 3, 4}, std::vector<double>{1, 3, 2, 4},
                      correlation_of, {.seed = 5});
  EXPECT_GT(result.undefined, 50U) << "4 of 256";
  EXPECT_LT(result.undefined, 400U);
  EXPECT_TRUE(std::isfinite(result.standard_error));
}

// Nothing defined without one of the units: no jackknife, no BCa.
TEST(Bootstrap, HasNoBcaWhereTheJackknifeFails) {
  const auto picky = [](std::span<const double> values) {
    return values.size() < 5 ? std::numeric_limits<double>::quiet_NaN() : mean_of(values);
  };
  const BootstrapResult result = bootstrap(std::vector<double>{1, 2, 3, 4, 5}, picky);
  EXPECT_TRUE(result.percentile);
  EXPECT_FALSE(result.bca);
}

TEST(Bootstrap, RefusesWhatItCannotDo) {
  const std::vector<double> values = {1.0, 2.0};
  EXPECT_THROW(bootstrap({}, mean_of), Error);
  EXPECT_THROW(bootstrap(values, mean_of, {.resamples = 1}), Error);
  EXPECT_THROW(bootstrap(values, mean_of, {.confidence = 1.0}), Error);
  EXPECT_THROW(bootstrap(std::vector<double>{std::nan("")}, mean_of), Error);
  EXPECT_THROW(bootstrap(values, [](std::span<const double>) { return std::nan(""); }), Error);
  EXPECT_THROW(bootstrap_clusters(std::vector<std::vector<double>>{{}}, mean_of), Error);
  EXPECT_THROW(clustered_success_difference({}), Error);
  std::stop_source stop;
  stop.request_stop();
  try {
    bootstrap(values, mean_of, {.stop = stop.get_token()});
    FAIL() << "not stopped";
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::kCancelled);
  }
}

TEST(Bootstrap, CoversAsOftenAsItSays) {
  Random random(6);
  constexpr int kRounds = 800;
  int bca = 0;
  int percentile = 0;
  for (int round = 0; round < kRounds; ++round) {
    std::vector<double> values(40);
    for (double& value : values) value = -std::log(1.0 - random.uniform());  // mean 1, skewed
    const BootstrapResult result =
        bootstrap(values, mean_of, {.resamples = 800, .seed = random.draw_seed()});
    bca += result.bca->contains(1.0) ? 1 : 0;
    percentile += result.percentile->contains(1.0) ? 1 : 0;
  }
  // Both are known to fall a little short with so few skewed values.
  EXPECT_NEAR(bca / static_cast<double>(kRounds), 0.935, 0.025);
  EXPECT_NEAR(percentile / static_cast<double>(kRounds), 0.925, 0.025);
}

std::vector<PairedTrial> clustered_trials(Random& random, std::size_t clusters, double gain) {
  std::vector<PairedTrial> trials;
  for (std::size_t cluster = 0; cluster < clusters; ++cluster) {
    const double base = random.uniform(0.1, 0.6);
    const double effect = gain + random.uniform(-0.2, 0.2);  // differs between pairs of maps
    for (int i = 0; i < 40; ++i) {
      const double luck = random.uniform();
      trials.push_back({100 + cluster, luck < base + effect, luck < base});
    }
  }
  return trials;
}

TEST(ClusteredSuccessDifference, CountsAllTrials) {
  const std::vector<PairedTrial> trials = {{7, true, false}, {7, true, true},  {3, false, false},
                                           {3, true, false}, {9, false, true}, {9, true, true}};
  const ClusteredDifference result = clustered_success_difference(trials, {.resamples = 200});
  EXPECT_EQ(result.clusters, 3U);
  EXPECT_EQ(result.trials, 6U);
  EXPECT_DOUBLE_EQ(result.first_rate, 4.0 / 6.0);
  EXPECT_DOUBLE_EQ(result.second_rate, 3.0 / 6.0);
  EXPECT_DOUBLE_EQ(result.difference.estimate, 1.0 / 6.0);
}

TEST(ClusteredSuccessDifference, IsTheClusterBootstrapOfTheDifferences) {
  Random random(8);
  const std::vector<PairedTrial> trials = clustered_trials(random, 12, 0.1);
  std::vector<std::vector<double>> clusters(12);
  for (const PairedTrial& trial : trials) {
    clusters[trial.cluster - 100].push_back((trial.first ? 1.0 : 0.0) - (trial.second ? 1.0 : 0.0));
  }
  for (const auto resampling : {ClusterResampling::kWhole, ClusterResampling::kTwoStage}) {
    const BootstrapOptions options{.resamples = 1000, .seed = 4};
    const BootstrapResult counted =
        clustered_success_difference(trials, options, resampling).difference;
    const BootstrapResult pooled = bootstrap_clusters(clusters, mean_of, options, resampling);
    EXPECT_NEAR(counted.bca->low, pooled.bca->low, 1e-9);
    EXPECT_NEAR(counted.bca->high, pooled.bca->high, 1e-9);
    EXPECT_NEAR(counted.percentile->low, pooled.percentile->low, 1e-12);
  }
}

// The reason for it: trials of one pair of maps are not independent, and an interval that takes them for
// it covers far too rarely.
TEST(ClusteredSuccessDifference, CoversWhereResamplingTrialsDoesNot) {
  Random random(12);
  constexpr int kRounds = 300;
  int clustered = 0;
  int naive = 0;
  for (int round = 0; round < kRounds; ++round) {
    std::vector<PairedTrial> trials = clustered_trials(random, 30, 0.1);
    const BootstrapOptions options{.resamples = 400, .seed = random.draw_seed()};
    clustered +=
        clustered_success_difference(trials, options).difference.bca->contains(0.1) ? 1 : 0;
    for (std::size_t i = 0; i < trials.size(); ++i) trials[i].cluster = i;
    naive += clustered_success_difference(trials, options).difference.bca->contains(0.1) ? 1 : 0;
  }
  EXPECT_NEAR(clustered / static_cast<double>(kRounds), 0.94, 0.035);
  EXPECT_LT(naive / static_cast<double>(kRounds), 0.75);
}

TEST(ClusteredSuccessDifference, TakesOneClusterAndNoDifference) {
  const std::vector<PairedTrial> one = {{1, true, false}, {1, false, false}};
  EXPECT_FALSE(clustered_success_difference(one, {.resamples = 50}).difference.bca);
  const std::vector<PairedTrial> equal = {{1, true, true}, {2, false, false}, {3, true, true}};
  EXPECT_EQ(clustered_success_difference(equal, {.resamples = 50}).difference.bca->width(), 0.0);
}

}  // namespace
}  // namespace cairn
