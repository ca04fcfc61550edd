// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/experiments/statistics/proportion.hpp"

#include <array>
#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "cairn/core/error.hpp"
#include "cairn/experiments/statistics/distributions.hpp"

namespace cairn {
namespace {

struct PublishedInterval {
  SuccessCount count;
  Interval wilson;
  Interval exact;
};

// Newcombe, Statistics in Medicine 17, 857-872 (1998), table I: methods 3 and 5.
constexpr std::array<PublishedInterval, 4> kNewcombe = {{
    {{81, 263}, {0.2553, 0.3662}, {0.2527, 0.3676}},
    {{15, 148}, {0.0624, 0.1605}, {0.0578, 0.1617}},
    {{0, 20}, {0.0000, 0.1611}, {0.0000, 0.1684}},
    {{1, 29}, {0.0061, 0.1718}, {0.0009, 0.1776}},
}};

TEST(ClusteredProportion, CountsClustersThatAreAllOrNothingOnce) {
  std::vector<SuccessCount> clusters;
  for (int i = 0; i < 21; ++i) clusters.push_back({i % 3 == 0 ? 200U : 0U, 200U});
  const Proportion clustered = clustered_proportion(clusters);
  EXPECT_EQ(clustered.count.trials, 4200U);
  EXPECT_NEAR(*clustered.estimate, 1.0 / 3.0, 1e-12);
  // A bit wider than of 21 independent trials, far wider than of 4,200.
  const Interval few = wilson_interval({7, 21});
  EXPECT_LT(clustered.interval.low, few.low);
  EXPECT_GT(clustered.interval.high, few.high);
  EXPECT_NEAR(clustered.interval.high - clustered.interval.low, few.high - few.low, 0.05);
}

TEST(ClusteredProportion, IsNeverCertainForClustersThatAreAlike) {
  const std::vector<SuccessCount> none(5, SuccessCount{0, 200});
  EXPECT_EQ(clustered_proportion(none).interval.low, 0.0);
  EXPECT_GT(clustered_proportion(none).interval.high, wilson_interval({0, 5}).high);
  const Proportion one = clustered_proportion(std::vector<SuccessCount>{{30, 200}, {0, 0}});
  EXPECT_EQ(one.interval.low, 0.0);
  EXPECT_EQ(one.interval.high, 1.0);
  EXPECT_FALSE(clustered_proportion({}).estimate);
}

TEST(WilsonInterval, AgreesWithNewcombe1998) {
  for (const PublishedInterval& published : kNewcombe) {
    const Interval interval = wilson_interval(published.count);
    EXPECT_NEAR(interval.low, published.wilson.low, 5e-5);
    EXPECT_NEAR(interval.high, published.wilson.high, 5e-5);
  }
}

TEST(ClopperPearsonInterval, AgreesWithNewcombe1998) {
  for (const PublishedInterval& published : kNewcombe) {
    const Interval interval = clopper_pearson_interval(published.count);
    EXPECT_NEAR(interval.low, published.exact.low, 5e-5);
    EXPECT_NEAR(interval.high, published.exact.high, 5e-5);
  }
}

// What defines it: at its ends the observed rate is z standard deviations of the binomial off.
TEST(WilsonInterval, InvertsTheScoreTest) {
  for (const double confidence : {0.5, 0.9, 0.99}) {
    const double z = normal_two_sided_quantile(confidence);
    const Interval interval = wilson_interval({7, 40}, confidence);
    for (const double p : {interval.low, interval.high}) {
      EXPECT_NEAR(std::abs(7.0 / 40.0 - p), z * std::sqrt(p * (1.0 - p) / 40.0), 1e-14);
    }
  }
}

TEST(WilsonInterval, OfFailuresIsTheComplement) {
  for (std::size_t successes = 0; successes <= 23; ++successes) {
    const Interval interval = wilson_interval({successes, 23});
    const Interval mirrored = wilson_interval({23 - successes, 23});
    EXPECT_NEAR(interval.low, 1.0 - mirrored.high, 1e-15);
    EXPECT_NEAR(interval.high, 1.0 - mirrored.low, 1e-15);
    EXPECT_TRUE(interval.contains(static_cast<double>(successes) / 23.0));
    EXPECT_GT(interval.width(), 0.0);
  }
}

TEST(WilsonInterval, KnowsNothingOfNoTrials) {
  const Proportion none = estimate_proportion({0, 0});
  EXPECT_FALSE(none.estimate);
  EXPECT_EQ(none.interval.low, 0.0);
  EXPECT_EQ(none.interval.high, 1.0);
  EXPECT_EQ(clopper_pearson_interval({0, 0}).width(), 1.0);
  EXPECT_EQ(wilson_interval({50, 50}).high, 1.0);
  EXPECT_EQ(*estimate_proportion({3, 4}).estimate, 0.75);
}

// How often the interval covers the truth, summed over all outcomes, no simulation.
double coverage(double p, std::size_t trials, Interval (*interval)(SuccessCount, double)) {
  double covered = 0.0;
  for (std::size_t k = 0; k <= trials; ++k) {
    if (interval({k, trials}, 0.95).contains(p)) covered += binomial_probability(k, trials, p);
  }
  return covered;
}

TEST(ProportionIntervals, CoverAsOftenAsTheySay) {
  for (const std::size_t trials : {std::size_t{10}, std::size_t{50}}) {
    double wilson = 0.0;
    for (int i = 0; i < 500; ++i) {
      const double p = (i + 0.5) / 500.0;
      wilson += coverage(p, trials, wilson_interval) / 500.0;
      EXPECT_GE(coverage(p, trials, clopper_pearson_interval), 0.95) << p;
    }
    EXPECT_NEAR(wilson, 0.95, 0.006) << "on average over the rates";
  }
}

struct PublishedDifference {
  SuccessCount first;
  SuccessCount second;
  Interval interval;
};

// Newcombe, Statistics in Medicine 17, 873-890 (1998), table II, method 10.
constexpr std::array<PublishedDifference, 8> kDifferences = {{
    {{56, 70}, {48, 80}, {0.0524, 0.3339}},
    {{9, 10}, {3, 10}, {0.1705, 0.8090}},
    {{6, 7}, {2, 7}, {0.0582, 0.8062}},
    {{5, 56}, {0, 29}, {-0.0381, 0.1926}},
    {{0, 10}, {0, 20}, {-0.1611, 0.2775}},
    {{0, 10}, {0, 10}, {-0.2775, 0.2775}},
    {{10, 10}, {0, 20}, {0.6791, 1.0000}},
    {{10, 10}, {0, 10}, {0.6075, 1.0000}},
}};

TEST(IndependentDifference, AgreesWithNewcombe1998) {
  for (const PublishedDifference& published : kDifferences) {
    const auto difference = independent_difference(published.first, published.second);
    ASSERT_TRUE(difference);
    EXPECT_NEAR(difference->interval.low, published.interval.low, 5e-5);
    EXPECT_NEAR(difference->interval.high, published.interval.high, 5e-5);
  }
  EXPECT_FALSE(independent_difference({0, 0}, {1, 2}));
}

TEST(CohensH, IsTheDifferenceOfAngles) {
  EXPECT_DOUBLE_EQ(cohens_h(1.0, 0.0), std::numbers::pi);
  EXPECT_DOUBLE_EQ(cohens_h(0.5, 0.25), std::numbers::pi / 6.0);
  EXPECT_DOUBLE_EQ(cohens_h(0.2, 0.7), -cohens_h(0.7, 0.2));
  EXPECT_EQ(cohens_h(0.4, 0.4), 0.0);
}

TEST(Proportions, RefuseWhatIsNone) {
  EXPECT_THROW(wilson_interval({3, 2}), Error);
  EXPECT_THROW(wilson_interval({1, 2}, 1.0), Error);
  EXPECT_THROW(wilson_interval({1, 2}, std::nan("")), Error);
  EXPECT_THROW(clopper_pearson_interval({1, 2}, 0.0), Error);
  EXPECT_THROW(cohens_h(1.1, 0.5), Error);
  EXPECT_THROW(cohens_h(0.5, std::nan("")), Error);
}

}  // namespace
}  // namespace cairn
