// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/core/statistics.hpp"

#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "cairn/core/error.hpp"
#include "cairn/core/random.hpp"

namespace cairn {
namespace {

TEST(ErrorStatistics, AreThoseOfTheErrors) {
  const auto statistics = statistics_of(std::vector<double>{3.0, 1.0, 2.0, 6.0});
  ASSERT_TRUE(statistics);
  EXPECT_EQ(statistics->count, 4U);
  EXPECT_DOUBLE_EQ(statistics->mean, 3.0);
  EXPECT_DOUBLE_EQ(statistics->median, 2.5);
  EXPECT_DOUBLE_EQ(statistics->rmse, std::sqrt(12.5));
  EXPECT_DOUBLE_EQ(statistics->standard_deviation, std::sqrt(3.5));
  EXPECT_EQ(statistics->lowest, 1.0);
  EXPECT_DOUBLE_EQ(statistics->percentile_95, 5.55) << "0.85 of the way from 3 to 6";
  EXPECT_EQ(statistics->highest, 6.0);
  EXPECT_FALSE(statistics_of({}));
}

TEST(Quantile, IsLinearBetweenTheNearest) {
  const std::vector<double> values = {40.0, 10.0, 20.0};
  EXPECT_EQ(quantile(values, 0.0), 10.0);
  EXPECT_EQ(quantile(values, 0.25), 15.0);
  EXPECT_EQ(quantile(values, 0.5), 20.0);
  EXPECT_EQ(quantile(values, 1.0), 40.0);
  EXPECT_EQ(quantile(std::vector<double>{7.0}, 0.3), 7.0);
}

TEST(Quantile, RefusesWhatHasNone) {
  EXPECT_THROW(quantile({}, 0.5), Error);
  EXPECT_THROW(quantile(std::vector<double>{1.0}, 1.1), Error);
  EXPECT_THROW(quantile(std::vector<double>{1.0}, std::nan("")), Error);
}

TEST(NthLowest, CountsFromTheLowest) {
  const std::vector<int> values = {40, 10, 20, 30};
  for (int i = 0; i < 4; ++i) {
    EXPECT_EQ(nth_lowest(std::vector<int>(values), static_cast<std::size_t>(i)), 10 * (i + 1));
  }
  EXPECT_EQ(upper_median(std::vector<int>(values)), 30);
  EXPECT_EQ(upper_median(std::vector<float>{7.0F}), 7.0F);
  EXPECT_EQ(lower_quantile(std::vector<int>(values), 0.6), 20);
  EXPECT_EQ(lower_quantile(std::vector<int>(values), 1.0), 40);
}

// Every value of a grid, some of them twice, in any order.
std::vector<double> on_grid(double step, double offset, double noise = 0.0) {
  Random random(1);
  std::vector<double> values;
  for (int i = 0; i < 1000; ++i) {
    const auto place = static_cast<double>(random.index(60)) - 20.0;
    values.push_back(offset + step * place + noise * random.normal());
  }
  return values;
}

TEST(CommonStep, IsThatOfAGridWhereverItStands) {
  for (const double offset : {0.0, 0.071, -3e5}) {
    EXPECT_NEAR(common_step(on_grid(0.15, offset)), 0.15, 1e-6) << offset;
  }
  std::vector<double> sparse = on_grid(0.15, 0.0);
  std::erase_if(sparse, [](double value) { return std::abs(value - 0.9) < 0.5; });
  EXPECT_NEAR(common_step(sparse), 0.15, 1e-6);
}

TEST(CommonStep, ThereIsNoneWithoutAGrid) {
  EXPECT_EQ(common_step({}), 0.0);
  EXPECT_EQ(common_step(on_grid(0.0, 1.0)), 0.0);
  EXPECT_EQ(common_step(on_grid(0.15, 0.0, 0.05)), 0.0);
  EXPECT_EQ(common_step(std::vector<double>{0.0, 1.0, 2.0, 3.0, 0.0, 1.0, 2.0, 3.0}), 0.0);
  Random random(2);
  std::vector<double> anywhere(1000);
  for (double& value : anywhere) value = random.uniform();
  EXPECT_EQ(common_step(anywhere), 0.0);
  // Each of few values twice, at irregular places.
  anywhere.resize(30);
  anywhere.insert(anywhere.end(), anywhere.begin(), anywhere.end());
  EXPECT_EQ(common_step(anywhere), 0.0);
}

}  // namespace
}  // namespace cairn
