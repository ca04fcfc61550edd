// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/experiments/detail/success_rate.hpp"

#include <array>
#include <cmath>
#include <vector>

#include <gtest/gtest.h>

namespace cairn::detail {
namespace {

struct PublishedInterval {
  SuccessCount count;
  double low;
  double high;
};

// Newcombe, Statistics in Medicine 17, 857-872 (1998), table I, method 3.
constexpr std::array<PublishedInterval, 4> kNewcombe = {{{{81, 263}, 0.2553, 0.3662},
                                                         {{15, 148}, 0.0624, 0.1605},
                                                         {{0, 20}, 0.0000, 0.1611},
                                                         {{1, 29}, 0.0061, 0.1718}}};

TEST(IndependentRate, AgreesWithNewcombe1998) {
  for (const PublishedInterval& published : kNewcombe) {
    const SuccessRate rate = RateEstimator(0.95).independent(published.count);
    EXPECT_NEAR(rate.low, published.low, 5e-5);
    EXPECT_NEAR(rate.high, published.high, 5e-5);
  }
}

TEST(IndependentRate, OfFailuresIsTheComplement) {
  for (std::size_t successes = 0; successes <= 23; ++successes) {
    const SuccessRate rate = RateEstimator(0.95).independent({successes, 23});
    const SuccessRate mirrored = RateEstimator(0.95).independent({23 - successes, 23});
    EXPECT_NEAR(rate.low, 1.0 - mirrored.high, 1e-15);
    EXPECT_NEAR(rate.high, 1.0 - mirrored.low, 1e-15);
    EXPECT_LE(rate.low, *rate.share());
    EXPECT_GE(rate.high, *rate.share());
    EXPECT_LT(rate.low, rate.high);
  }
}

TEST(IndependentRate, KnowsNothingOfNoTrials) {
  const SuccessRate none = RateEstimator(0.95).independent({0, 0});
  EXPECT_FALSE(none.share());
  EXPECT_EQ(none.low, 0.0);
  EXPECT_EQ(none.high, 1.0);
}

TEST(ClusteredRate, CountsClustersThatAreAllOrNothingOnce) {
  std::vector<SuccessCount> clusters;
  for (int i = 0; i < 21; ++i) clusters.push_back({i % 3 == 0 ? 200U : 0U, 200U});
  const SuccessRate clustered = RateEstimator(0.95).clustered(clusters);
  EXPECT_EQ(clustered.trials, 4200U);
  EXPECT_NEAR(*clustered.share(), 1.0 / 3.0, 1e-12);
  // A bit wider than of 21 independent trials, far wider than of 4,200.
  const SuccessRate few = RateEstimator(0.95).independent({7, 21});
  EXPECT_LT(clustered.low, few.low);
  EXPECT_GT(clustered.high, few.high);
  EXPECT_NEAR(clustered.high - clustered.low, few.high - few.low, 0.05);
}

// Of alike clusters each counts as (z / t)² trials, with Student's t as tables have it.
TEST(ClusteredRate, WidensForFewClustersByStudentsDistribution) {
  struct Tabulated {
    std::size_t clusters;
    double confidence;
    double z;
    double t;
  };
  for (const Tabulated& one :
       {Tabulated{2, 0.95, 1.959964, 12.706205}, Tabulated{3, 0.9, 1.644854, 2.919986},
        Tabulated{6, 0.99, 2.575829, 4.032143}, Tabulated{101, 0.95, 1.959964, 1.983972}}) {
    const std::vector<SuccessCount> none(one.clusters, SuccessCount{0, 50});
    const double trials = static_cast<double>(one.clusters) * std::pow(one.z / one.t, 2);
    const double expected = one.z * one.z / (trials + one.z * one.z);
    EXPECT_NEAR(RateEstimator(one.confidence).clustered(none).high, expected, 1e-6) << one.clusters;
    EXPECT_EQ(RateEstimator(one.confidence).clustered(none).low, 0.0);
  }
}

TEST(ClusteredRate, OfOneClusterKnowsNothing) {
  const SuccessRate one =
      RateEstimator(0.95).clustered(std::vector<SuccessCount>{{30, 200}, {0, 0}});
  EXPECT_EQ(one.low, 0.0);
  EXPECT_EQ(one.high, 1.0);
  EXPECT_FALSE(RateEstimator(0.95).clustered({}).share());
}

}  // namespace
}  // namespace cairn::detail
