// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/experiments/statistics/distributions.hpp"

#include <cmath>
#include <cstdint>
#include <limits>
#include <numbers>
#include <vector>

#include <gtest/gtest.h>

#include "cairn/experiments/statistics/moments.hpp"
#include "cairn/experiments/statistics/ranks.hpp"

namespace cairn {
namespace {

// Quantiles as tables of every textbook have them.
TEST(Distributions, HaveTheQuantilesOfTheTables) {
  EXPECT_NEAR(normal_quantile(0.975), 1.959963984540054, 1e-14);
  EXPECT_NEAR(normal_two_sided_quantile(0.9), 1.6448536269514722, 1e-14);
  EXPECT_NEAR(student_t_quantile(0.975, 10.0), 2.228, 5e-4);
  EXPECT_NEAR(chi_squared_upper_tail(3.841, 1.0), 0.05, 1e-4);
  EXPECT_NEAR(fisher_f_upper_tail(4.2565, 2.0, 9.0), 0.05, 1e-4);
}

TEST(Distributions, AgreeWithClosedForms) {
  EXPECT_DOUBLE_EQ(normal_cdf(0.0), 0.5);
  EXPECT_DOUBLE_EQ(normal_cdf(1.3) + normal_upper_tail(1.3), 1.0);
  EXPECT_NEAR(normal_upper_tail(10.0) / 7.619853024160527e-24, 1.0, 1e-12) << "far in the tail";
  // With one degree of freedom Student's is Cauchy's, with two chi-squared is exponential.
  EXPECT_NEAR(student_t_upper_tail(2.0, 1.0), 0.5 - std::atan(2.0) / std::numbers::pi, 1e-15);
  EXPECT_NEAR(chi_squared_upper_tail(5.0, 2.0), std::exp(-2.5), 1e-15);
  EXPECT_NEAR(beta_quantile(0.3, 1.0, 4.0), 1.0 - std::pow(0.7, 0.25), 1e-14);
  const double infinity = std::numeric_limits<double>::infinity();
  EXPECT_EQ(student_t_upper_tail(infinity, 3.0), 0.0);
  EXPECT_EQ(student_t_upper_tail(-infinity, 3.0), 1.0);
  EXPECT_EQ(fisher_f_upper_tail(infinity, 3.0, 4.0), 0.0);
}

TEST(Distributions, BinomialIsTheSumOfItsTerms) {
  for (const double p : {0.5, 0.13}) {
    double coefficient = 1.0;
    double sum = 0.0;
    for (std::uint64_t k = 0; k <= 12; ++k) {
      const auto x = static_cast<double>(k);
      const double term = coefficient * std::pow(p, x) * std::pow(1.0 - p, 12.0 - x);
      sum += term;
      EXPECT_NEAR(binomial_probability(k, 12, p), term, 1e-14);
      EXPECT_NEAR(binomial_cdf(k, 12, p), sum, 1e-14);
      coefficient *= (12.0 - x) / (x + 1.0);
    }
  }
  EXPECT_EQ(binomial_cdf(0, 0, 0.5), 1.0);
  EXPECT_EQ(binomial_probability(3, 2, 0.5), 0.0);
}

TEST(MidRanks, ShareTheRanksOfEqualValues) {
  const Ranks ranks = mid_ranks(std::vector<double>{3.0, 1.0, 3.0, 2.0, 3.0, 1.0});
  EXPECT_EQ(ranks.values, (std::vector<double>{5.0, 1.5, 5.0, 3.0, 5.0, 1.5}));
  EXPECT_EQ(ranks.ties, (std::vector<std::size_t>{2, 3}));
  EXPECT_EQ(ranks.tie_term(), 6.0 + 24.0);
  EXPECT_TRUE(mid_ranks({}).values.empty());
}

TEST(Moments, AreThoseOfASample) {
  const std::vector<double> values = {2.0, 4.0, 4.0, 4.0, 5.0, 5.0, 7.0, 9.0};
  EXPECT_DOUBLE_EQ(*sample_mean(values), 5.0);
  EXPECT_DOUBLE_EQ(*sample_deviation(values), std::sqrt(32.0 / 7.0));
  EXPECT_FALSE(sample_mean({}));
  EXPECT_FALSE(sample_deviation(std::vector<double>{1.0}));
  EXPECT_EQ(*sample_deviation(std::vector<double>{0.1, 0.1, 0.1}), 0.0) << "exactly";
}

}  // namespace
}  // namespace cairn
