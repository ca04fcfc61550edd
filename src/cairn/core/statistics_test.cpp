// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/core/statistics.hpp"

#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "cairn/core/error.hpp"

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

}  // namespace
}  // namespace cairn
