// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/experiments/statistics/effect_size.hpp"

#include <cmath>
#include <cstddef>
#include <vector>

#include <gtest/gtest.h>

#include "cairn/core/error.hpp"
#include "cairn/core/random.hpp"

namespace cairn {
namespace {

// The example of R's effsize, cliff.delta(): -0.25, interval -0.7265846 to 0.3890062. By the rank sums
// A is 0.375.
TEST(CliffsDelta, AgreesWithEffsize) {
  const std::vector<double> treatment = {10, 10, 20, 20, 20, 30, 30, 30, 40, 50};
  const std::vector<double> control = {10, 20, 30, 40, 40, 50};
  const auto dominance = cliffs_delta(treatment, control);
  ASSERT_TRUE(dominance);
  EXPECT_DOUBLE_EQ(dominance->delta, -0.25);
  EXPECT_DOUBLE_EQ(dominance->vargha_delaney_a, 0.375);
  EXPECT_NEAR(dominance->interval->low, -0.7265846, 5e-8);
  EXPECT_NEAR(dominance->interval->high, 0.3890062, 5e-8);
}

TEST(CliffsDelta, CountsAllPairs) {
  Random random(3);
  for (int round = 0; round < 20; ++round) {
    std::vector<double> x(1 + random.index(8));
    std::vector<double> y(1 + random.index(8));
    for (double& value : x) value = static_cast<double>(random.index(5));
    for (double& value : y) value = static_cast<double>(random.index(5));
    double delta = 0.0;
    for (const double a : x) {
      for (const double b : y) delta += a > b ? 1.0 : (a < b ? -1.0 : 0.0);
    }
    delta /= static_cast<double>(x.size() * y.size());
    EXPECT_NEAR(cliffs_delta(x, y)->delta, delta, 1e-12);
    EXPECT_NEAR(cliffs_delta(y, x)->delta, -delta, 1e-12);
    EXPECT_EQ(cliffs_delta(x, y)->interval.has_value(), x.size() > 1 && y.size() > 1);
  }
}

TEST(CliffsDelta, TakesGroupsThatDoNotOverlapAndTies) {
  const auto apart = cliffs_delta(std::vector<double>{4, 5}, std::vector<double>{1, 2, 3});
  EXPECT_EQ(apart->delta, 1.0);
  EXPECT_EQ(apart->vargha_delaney_a, 1.0);
  EXPECT_EQ(apart->interval->width(), 0.0);
  const auto tied = cliffs_delta(std::vector<double>{1, 1}, std::vector<double>{1, 1, 1});
  EXPECT_EQ(tied->delta, 0.0);
  EXPECT_GT(tied->interval->width(), 0.0);
  EXPECT_FALSE(cliffs_delta({}, std::vector<double>{1.0}));
  EXPECT_THROW(cliffs_delta(std::vector<double>{std::nan("")}, std::vector<double>{1.0}), Error);
}

TEST(CliffsDelta, CoversAsOftenAsItSays) {
  // P(X > Y) for standard exponentials with means 2 and 1 is 2/3, hence delta 1/3.
  Random random(31);
  constexpr int kRounds = 3000;
  int covered = 0;
  for (int round = 0; round < kRounds; ++round) {
    std::vector<double> x(25);
    std::vector<double> y(30);
    for (double& value : x) value = -2.0 * std::log(1.0 - random.uniform());
    for (double& value : y) value = -std::log(1.0 - random.uniform());
    covered += cliffs_delta(x, y)->interval->contains(1.0 / 3.0) ? 1 : 0;
  }
  EXPECT_NEAR(covered / static_cast<double>(kRounds), 0.95, 0.015);
}

// R's sleep data again: t(9) = -4.062128 is d_z·sqrt(10).
TEST(CohensDz, IsTheTStatisticOverTheRootOfTheCount) {
  const std::vector<double> differences = {-1.2, -2.4, -1.3, -1.3, 0.0,
                                           -1.0, -1.8, -0.8, -4.6, -1.4};
  EXPECT_NEAR(*cohens_dz(differences), -4.062128 / std::sqrt(10.0), 5e-7);
  EXPECT_FALSE(cohens_dz(std::vector<double>{0.1, 0.1, 0.1}));
  EXPECT_FALSE(cohens_dz(std::vector<double>{0.1}));
}

}  // namespace
}  // namespace cairn
