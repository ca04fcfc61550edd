// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/experiments/statistics/density.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <vector>

#include <gtest/gtest.h>

#include "cairn/core/error.hpp"
#include "cairn/core/statistics.hpp"

namespace cairn {
namespace {

// Fuel consumption of the cars of R's mtcars data set (Motor Trend 1974).
std::vector<double> mtcars() {
  return {21.0, 21.0, 22.8, 21.4, 18.7, 18.1, 14.3, 24.4, 22.8, 19.2, 17.8,
          16.4, 17.3, 15.2, 10.4, 10.4, 14.7, 32.4, 30.4, 33.9, 21.5, 15.5,
          15.2, 13.3, 19.2, 27.3, 26.0, 30.4, 15.8, 19.7, 15.0, 21.4};
}

// R's density(mtcars$mpg): bandwidth 2.477, on 2.97 to 41.33, at most 6.795e-02, which R's
// binning of the values makes coarse.
TEST(KernelDensity, AgreesWithR) {
  const auto density = kernel_density(mtcars(), {.points = 512});
  ASSERT_TRUE(density);
  EXPECT_NEAR(density->bandwidth, 2.477, 5e-4);
  EXPECT_NEAR(density->positions.front(), 2.97, 5e-3);
  EXPECT_NEAR(density->positions.back(), 41.33, 5e-3);
  EXPECT_NEAR(*std::max_element(density->densities.begin(), density->densities.end()), 6.795e-02,
              1e-4);
}

double integral(const Density& density) {
  double sum = 0.0;
  for (std::size_t i = 1; i < density.positions.size(); ++i) {
    sum += 0.5 * (density.densities[i] + density.densities[i - 1]) *
           (density.positions[i] - density.positions[i - 1]);
  }
  return sum;
}

TEST(KernelDensity, IntegratesToOne) {
  EXPECT_NEAR(integral(*kernel_density(mtcars(), {.points = 1000, .reach = 6.0})), 1.0, 1e-5);
  const auto cut = kernel_density(mtcars(), {.points = 1000, .reach = 0.0});
  EXPECT_EQ(cut->positions.front(), 10.4);
  EXPECT_EQ(cut->positions.back(), 33.9);
  EXPECT_LT(integral(*cut), 0.98);
}

TEST(KernelDensity, OfOneValueIsTheKernel) {
  const auto density =
      kernel_density(std::vector<double>{3.0}, {.bandwidth = 2.0, .points = 3, .reach = 1.0});
  ASSERT_TRUE(density);
  const double peak = 1.0 / (2.0 * std::sqrt(2.0 * std::numbers::pi));
  EXPECT_DOUBLE_EQ(density->positions[1], 3.0);
  EXPECT_DOUBLE_EQ(density->densities[1], peak);
  EXPECT_DOUBLE_EQ(density->densities[0], peak * std::exp(-0.5));
}

TEST(KernelBandwidth, FollowsTheRules) {
  const double silverman = *kernel_bandwidth(mtcars());
  EXPECT_DOUBLE_EQ(*kernel_bandwidth(mtcars(), BandwidthRule::kScott), silverman * 1.06 / 0.9);
  // Quartiles that are equal tell nothing.
  const std::vector<double> mostly = {1, 1, 1, 1, 1, 1, 1, 9};
  EXPECT_DOUBLE_EQ(*kernel_bandwidth(mostly), 0.9 * std::sqrt(8.0) * std::pow(8.0, -0.2));
  EXPECT_FALSE(kernel_bandwidth(std::vector<double>(5, 2.0)));
  EXPECT_FALSE(kernel_density(std::vector<double>(5, 2.0)));
  EXPECT_FALSE(kernel_density({}, {.bandwidth = 1.0}));
}

TEST(KernelDensity, RefusesOptionsOutOfRange) {
  EXPECT_THROW(kernel_density(mtcars(), {.bandwidth = 0.0}), Error);
  EXPECT_THROW(kernel_density(mtcars(), {.points = 1}), Error);
  EXPECT_THROW(kernel_density(mtcars(), {.reach = -1.0}), Error);
  EXPECT_THROW(kernel_density(std::vector<double>{std::nan("")}), Error);
}

// R's summary(mtcars$mpg): 10.40, 15.43, 19.20, 22.80, 33.90, quantiles of type 7.
TEST(BoxSummary, AgreesWithR) {
  const auto box = box_summary(mtcars());
  ASSERT_TRUE(box);
  EXPECT_EQ(box->count, 32U);
  EXPECT_EQ(box->lowest, 10.4);
  EXPECT_NEAR(box->lower_quartile, 15.43, 5.1e-3) << "15.425";
  EXPECT_NEAR(box->median, 19.2, 1e-12);
  EXPECT_NEAR(box->upper_quartile, 22.8, 1e-12);
  EXPECT_EQ(box->highest, 33.9);
  // The fence is at 22.8 + 1.5·7.375 = 33.8625; R's boxplot(), with Tukey's hinges, sets it at 33.975.
  EXPECT_EQ(box->upper_whisker, 32.4);
  EXPECT_EQ(box->outliers, (std::vector<double>{33.9}));
}

// Hyndman and Fan, type 7: the k-th of n values is the quantile of (k - 1)/(n - 1).
TEST(Quantile, IsOfType7) {
  std::vector<double> values;
  for (int i = 1; i <= 10; ++i) values.push_back(i);
  EXPECT_DOUBLE_EQ(quantile(values, 0.25), 3.25);
  EXPECT_DOUBLE_EQ(quantile(values, 0.75), 7.75);
  for (std::size_t k = 0; k < 10; ++k) {
    EXPECT_NEAR(quantile(values, static_cast<double>(k) / 9.0), values[k], 1e-12);
  }
}

TEST(BoxSummary, SetsOutliersApart) {
  const auto box = box_summary(std::vector<double>{5, 1, 2, 3, 4, 20, -15});
  ASSERT_TRUE(box);  // quartiles 1.5 and 4.5, fences -3 and 9
  EXPECT_EQ(box->lower_whisker, 1.0);
  EXPECT_EQ(box->upper_whisker, 5.0);
  EXPECT_EQ(box->outliers, (std::vector<double>{-15.0, 20.0}));
  const auto one = box_summary(std::vector<double>{2.0});
  EXPECT_EQ(one->lower_whisker, 2.0);
  EXPECT_EQ(one->upper_whisker, 2.0);
  EXPECT_FALSE(box_summary({}));
}

}  // namespace
}  // namespace cairn
