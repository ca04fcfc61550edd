// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/experiments/statistics/correlation.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <vector>

#include <gtest/gtest.h>

#include "cairn/core/error.hpp"
#include "cairn/core/random.hpp"
#include "cairn/experiments/statistics/ranks.hpp"

namespace cairn {
namespace {

// Lightness and quality of tuna: Hollander and Wolfe (1973), p. 187, the example of R's cor.test, whose
// Spearman test says rho 0.6, p-value 0.0968.
TEST(Spearman, AgreesWithHollanderAndWolfe) {
  const std::vector<double> x = {44.4, 45.9, 41.9, 53.3, 44.7, 44.1, 50.7, 45.2, 60.1};
  const std::vector<double> y = {2.6, 3.1, 2.5, 5.0, 3.6, 4.0, 5.2, 2.8, 3.8};
  const auto spearman = spearman_correlation(x, y);
  ASSERT_TRUE(spearman);
  EXPECT_NEAR(spearman->rho, 0.6, 1e-12);
  EXPECT_TRUE(spearman->exact);
  EXPECT_NEAR(spearman->p_value, 0.0968, 5e-5);
}

// The example of scipy.stats.spearmanr, with a tie: 0.82078268166812329, p 0.088587005313543812.
TEST(Spearman, AgreesWithScipyOnTies) {
  const std::vector<double> x = {1, 2, 3, 4, 5};
  const std::vector<double> y = {5, 6, 7, 8, 7};
  const auto spearman = spearman_correlation(x, y, {.method = PValueMethod::kAsymptotic});
  ASSERT_TRUE(spearman);
  EXPECT_NEAR(spearman->rho, 0.82078268166812329, 1e-14);
  EXPECT_NEAR(spearman->p_value, 0.088587005313543812, 1e-12);
  EXPECT_FALSE(spearman->exact);
}

// The example of Wikipedia, "Spearman's rank correlation coefficient": -29/165.
TEST(Spearman, IsTheTextbooksFormulaWithoutTies) {
  const std::vector<double> iq = {106, 100, 86, 101, 99, 103, 97, 113, 112, 110};
  const std::vector<double> hours = {7, 27, 2, 50, 28, 29, 20, 12, 6, 17};
  const auto spearman = spearman_correlation(iq, hours);
  ASSERT_TRUE(spearman);
  EXPECT_NEAR(spearman->rho, -29.0 / 165.0, 1e-14);
  EXPECT_FALSE(spearman->exact) << "ten pairs are too many to permute";
  // Bonett and Wright's interval, by hand.
  const double rho = -29.0 / 165.0;
  const double reach = 1.959963984540054 * std::sqrt((1.0 + rho * rho / 2.0) / 7.0);
  EXPECT_NEAR(spearman->interval->low, std::tanh(std::atanh(rho) - reach), 1e-12);
  EXPECT_NEAR(spearman->interval->high, std::tanh(std::atanh(rho) + reach), 1e-12);
}

TEST(Spearman, ExactCountsAllPermutations) {
  const std::vector<double> x = {1, 1, 2, 4, 5, 5};
  const std::vector<double> y = {2, 3, 3, 5, 9, 1};
  const std::vector<double> x_ranks = mid_ranks(x).values;
  std::vector<double> y_ranks = mid_ranks(y).values;
  const double observed = std::abs(*pearson_correlation(x_ranks, y_ranks));
  // All orders of the places, so that equal ranks count as often as they should.
  std::vector<std::size_t> order = {0, 1, 2, 3, 4, 5};
  int extreme = 0;
  do {
    std::vector<double> permuted;
    for (const std::size_t place : order) permuted.push_back(y_ranks[place]);
    extreme += std::abs(*pearson_correlation(x_ranks, permuted)) >= observed - 1e-12 ? 1 : 0;
  } while (std::next_permutation(order.begin(), order.end()));
  EXPECT_NEAR(spearman_correlation(x, y)->p_value, extreme / 720.0, 1e-12);
}

TEST(Spearman, TakesPerfectAndConstantRanks) {
  const std::vector<double> x = {1, 2, 3, 4, 5, 6, 7, 8, 9, 10};
  std::vector<double> y;
  for (const double value : x) y.push_back(-std::exp(value));
  const auto perfect = spearman_correlation(x, y);
  EXPECT_EQ(perfect->rho, -1.0);
  EXPECT_EQ(perfect->p_value, 0.0);
  EXPECT_FALSE(perfect->interval);
  EXPECT_FALSE(spearman_correlation(x, std::vector<double>(10, 1.0)));
  EXPECT_FALSE(spearman_correlation(std::vector<double>{1, 2}, std::vector<double>{1, 2}));
  const std::vector<double> three = {1, 2, 4};
  EXPECT_FALSE(spearman_correlation(three, std::vector<double>{1, 3, 2})->interval);
  EXPECT_DOUBLE_EQ(spearman_correlation(three, three)->p_value, 2.0 / 6.0);
}

TEST(Spearman, RefusesWhatIsNoPairs) {
  const std::vector<double> ten(10, 1.0);
  EXPECT_THROW(spearman_correlation(ten, std::vector<double>(9, 1.0)), Error);
  EXPECT_THROW(spearman_correlation(ten, ten, {.method = PValueMethod::kExact}), Error);
  EXPECT_THROW(spearman_correlation(ten, ten, {.confidence = 0.0}), Error);
  EXPECT_THROW(pearson_correlation(std::vector<double>{std::nan("")}, std::vector<double>{1.0}),
               Error);
}

TEST(Spearman, CoversAsOftenAsItSays) {
  // Of normal variables with correlation r, Spearman's is 6/π·asin(r/2).
  const double r = 0.6;
  const double rho = 6.0 / std::numbers::pi * std::asin(r / 2.0);
  Random random(41);
  constexpr int kRounds = 3000;
  int covered = 0;
  for (int round = 0; round < kRounds; ++round) {
    std::vector<double> x(60);
    std::vector<double> y(60);
    for (std::size_t i = 0; i < x.size(); ++i) {
      x[i] = random.normal();
      y[i] = r * x[i] + std::sqrt(1.0 - r * r) * random.normal();
    }
    covered += spearman_correlation(x, y)->interval->contains(rho) ? 1 : 0;
  }
  EXPECT_NEAR(covered / static_cast<double>(kRounds), 0.95, 0.015);
}

}  // namespace
}  // namespace cairn
