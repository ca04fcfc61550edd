// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/experiments/statistics/success_table.hpp"

#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "cairn/core/error.hpp"

namespace cairn {
namespace {

TEST(SuccessTable, CountsByBothOffsets) {
  const std::vector<DisplacedTrial> trials = {
      {0.0, 0.0, true},  {0.05, 0.4, true}, {0.1, 0.5, false}, {0.2, 1.0, true},
      {0.15, 0.7, true}, {0.3, 0.1, true},  {0.1, -0.1, true},
  };
  const std::vector<double> rotations = {0.0, 0.1, 0.2};
  const std::vector<double> translations = {0.0, 0.5, 1.0};
  const SuccessTable table = success_table(trials, rotations, translations);
  EXPECT_EQ(table.rows(), 2U);
  EXPECT_EQ(table.columns(), 2U);
  EXPECT_EQ(table.at(0, 0).count.trials, 2U);
  EXPECT_EQ(table.at(0, 0).count.successes, 2U);
  EXPECT_EQ(table.at(0, 1).count.trials, 0U);
  EXPECT_FALSE(table.at(0, 1).estimate);
  EXPECT_EQ(table.at(1, 1).count.trials, 3U) << "lower edges belong to a cell, the last upper too";
  EXPECT_EQ(table.at(1, 1).count.successes, 2U);
  EXPECT_EQ(table.outside, 2U);
  const Interval wilson = wilson_interval({2, 3});
  EXPECT_EQ(table.at(1, 1).interval.low, wilson.low);
  EXPECT_EQ(table.at(1, 1).interval.high, wilson.high);
}

TEST(SuccessTable, LosesNoTrial) {
  std::vector<DisplacedTrial> trials;
  for (int i = 0; i < 100; ++i) trials.push_back({i * 0.011, i * 0.007, i % 3 == 0});
  const std::vector<double> edges = {0.1, 0.25, 0.5};
  const SuccessTable table = success_table(trials, edges, edges);
  std::size_t sum = table.outside;
  for (const Proportion& cell : table.cells) sum += cell.count.trials;
  EXPECT_EQ(sum, 100U);
}

TEST(SuccessTable, RefusesEdgesThatDoNotAscend) {
  const std::vector<double> good = {0.0, 1.0};
  EXPECT_THROW(success_table({}, std::vector<double>{0.0}, good), Error);
  EXPECT_THROW(success_table({}, good, std::vector<double>{0.0, 0.0}), Error);
  EXPECT_THROW(success_table({}, good, std::vector<double>{0.0, std::nan("")}), Error);
  EXPECT_THROW(success_table(std::vector<DisplacedTrial>{{std::nan(""), 0.0, true}}, good, good),
               Error);
  EXPECT_THROW(success_bins(std::vector<double>{1.0}, {}, good), Error);
}

TEST(ConvergenceRadius, ReachesToTheFirstBinThatFallsShort) {
  const std::vector<double> offsets = {0.1, 0.2, 0.3, 1.1, 1.2, 1.3, 1.4, 2.5, 3.5};
  const std::vector<bool> success = {true, true, true, true, true, true, false, false, true};
  const auto bins = success_bins(offsets, success, std::vector<double>{0.0, 1.0, 2.0, 3.0, 4.0});
  ASSERT_EQ(bins.size(), 4U);
  EXPECT_EQ(*bins[1].rate.estimate, 0.75);
  EXPECT_EQ(convergence_radius(bins, 0.9), 1.0);
  EXPECT_EQ(convergence_radius(bins, 0.75), 2.0) << "the island at 3.5 does not count";
  EXPECT_EQ(convergence_radius(bins, 0.0), 4.0);
  EXPECT_FALSE(convergence_radius(bins, 0.75, RadiusCriterion::kLowerBound)) << "too few trials";
  EXPECT_EQ(convergence_radius(bins, 0.4, RadiusCriterion::kLowerBound), 1.0);
  EXPECT_THROW(convergence_radius(bins, 1.1), Error);
}

TEST(ConvergenceRadius, EndsWhereNothingWasTried) {
  const auto bins = success_bins(std::vector<double>{0.5, 2.5}, {true, true},
                                 std::vector<double>{0.0, 1.0, 2.0, 3.0});
  EXPECT_EQ(convergence_radius(bins, 0.5), 1.0);
  EXPECT_FALSE(convergence_radius({}, 0.5));
}

TEST(SuccessRadius, IsTheLargestWithTheRate) {
  const std::vector<double> offsets = {3.0, 1.0, 2.0, 4.0, 2.0, 5.0};
  const std::vector<bool> success = {true, true, true, false, false, false};
  const auto most = success_radius(offsets, success, 0.75);  // 1, 2/3 at 2, 3/4 at 3, 3/5, 1/2
  ASSERT_TRUE(most);
  EXPECT_EQ(most->radius, 3.0);
  EXPECT_EQ(most->rate.count.successes, 3U);
  EXPECT_EQ(most->rate.count.trials, 4U);
  EXPECT_EQ(success_radius(offsets, success, 1.0)->radius, 1.0);
  EXPECT_EQ(success_radius(offsets, success, 0.5)->radius, 5.0);
  EXPECT_FALSE(success_radius(std::vector<double>{1.0}, {false}, 0.5));
  EXPECT_FALSE(success_radius({}, {}, 0.5));
  EXPECT_THROW(success_radius(std::vector<double>{-1.0}, {false}, 0.5), Error);
  EXPECT_THROW(success_radius(offsets, success, std::nan("")), Error);
}

}  // namespace
}  // namespace cairn
