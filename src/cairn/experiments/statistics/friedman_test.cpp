// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/experiments/statistics/friedman.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/core/error.hpp"
#include "cairn/core/random.hpp"
#include "cairn/experiments/statistics/distributions.hpp"
#include "cairn/experiments/statistics/multiple_comparisons.hpp"
#include "cairn/experiments/statistics/paired_proportions.hpp"
#include "cairn/experiments/statistics/signed_rank.hpp"

namespace cairn {
namespace {

using ::testing::ElementsAre;
using ::testing::Pointwise;

using Blocks = std::vector<std::vector<double>>;

// Times to round first base by three methods: Hollander and Wolfe (1973), p. 140, the example of R's
// friedman.test.
const Blocks& rounding_times() {
  static const Blocks times = {
      {5.40, 5.50, 5.55}, {5.85, 5.70, 5.75}, {5.20, 5.60, 5.50}, {5.55, 5.50, 5.40},
      {5.90, 5.85, 5.70}, {5.45, 5.55, 5.60}, {5.40, 5.40, 5.35}, {5.45, 5.50, 5.35},
      {5.25, 5.15, 5.00}, {5.85, 5.80, 5.70}, {5.25, 5.20, 5.10}, {5.65, 5.55, 5.45},
      {5.60, 5.35, 5.45}, {5.05, 5.00, 4.95}, {5.50, 5.50, 5.40}, {5.45, 5.55, 5.50},
      {5.55, 5.55, 5.35}, {5.45, 5.50, 5.55}, {5.50, 5.45, 5.25}, {5.65, 5.60, 5.40},
      {5.70, 5.65, 5.55}, {6.30, 6.30, 6.25}};
  return times;
}

TEST(Friedman, AgreesWithHollanderAndWolfe) {
  const Friedman test = friedman_test(rounding_times());
  EXPECT_NEAR(test.statistic, 11.143, 5e-4);
  EXPECT_EQ(test.degrees_of_freedom, 2.0);
  EXPECT_NEAR(test.p_value, 0.003805, 5e-7);
  EXPECT_DOUBLE_EQ(*test.kendalls_w, test.statistic / 44.0);
  EXPECT_NEAR(*friedman_exact_p_value(rounding_times()), test.p_value, 2e-3);
}

// AUC of four classifiers on 14 data sets: Demšar, Journal of Machine Learning Research 7, 1-30
// (2006), table 6, with the negative of the AUC, for there the highest has rank 1. Two values equal
// to three digits (0.975) have different ranks in his table, hence the fourth and fifth.
Blocks demsar() {
  Blocks blocks = {
      {0.763, 0.768, 0.771, 0.798},   {0.599, 0.591, 0.590, 0.569}, {0.954, 0.971, 0.968, 0.967},
      {0.628, 0.661, 0.654, 0.657},   {0.882, 0.888, 0.886, 0.898}, {0.936, 0.931, 0.916, 0.931},
      {0.661, 0.668, 0.609, 0.685},   {0.583, 0.583, 0.563, 0.625}, {0.775, 0.838, 0.866, 0.875},
      {1.000, 1.000, 1.000, 1.000},   {0.940, 0.962, 0.965, 0.962}, {0.619, 0.666, 0.614, 0.669},
      {0.972, 0.981, 0.97501, 0.975}, {0.957, 0.978, 0.946, 0.970}};
  for (auto& block : blocks) {
    for (double& auc : block) auc = -auc;
  }
  return blocks;
}

TEST(Friedman, HasTheMeanRanksOfDemsar) {
  const Friedman test = friedman_test(demsar());
  EXPECT_THAT(test.mean_ranks, Pointwise(::testing::DoubleNear(5e-4),
                                         std::vector<double>{3.143, 2.000, 2.893, 1.964}));
  // His 9.28 and 3.69 do without the correction for ties, which only adds to them.
  double plain = 0.0;
  for (const double rank : test.mean_ranks) plain += (rank - 2.5) * (rank - 2.5);
  plain *= 12.0 * 14.0 / (4.0 * 5.0);
  EXPECT_NEAR(plain, 9.28, 5e-3);
  EXPECT_NEAR(13.0 * plain / (14.0 * 3.0 - plain), 3.69, 5e-3);
  EXPECT_GT(test.statistic, plain);
  EXPECT_DOUBLE_EQ(*test.f_statistic, 13.0 * test.statistic / (14.0 * 3.0 - test.statistic));
  EXPECT_DOUBLE_EQ(*test.f_p_value, fisher_f_upper_tail(*test.f_statistic, 3.0, 39.0));
}

// Cochran's Q of successes, by its own formula: (k-1)(kΣC² - T²) / (kT - ΣR²).
TEST(Friedman, OfSuccessesIsCochransQ) {
  const Blocks successes = {{1, 1, 0}, {1, 0, 0}, {1, 1, 1}, {0, 1, 0}, {1, 1, 0},
                            {0, 0, 0}, {1, 0, 1}, {1, 1, 0}, {1, 0, 0}, {1, 1, 0}};
  std::vector<double> columns(3, 0.0);
  double total = 0.0;
  double row_squares = 0.0;
  for (const auto& block : successes) {
    double row = 0.0;
    for (std::size_t i = 0; i < 3; ++i) {
      columns[i] += block[i];
      row += block[i];
    }
    total += row;
    row_squares += row * row;
  }
  double column_squares = 0.0;
  for (const double column : columns) column_squares += column * column;
  EXPECT_NEAR(friedman_test(successes).statistic,
              2.0 * (3.0 * column_squares - total * total) / (3.0 * total - row_squares), 1e-12);
}

// The statistics of all assignments of ranks within blocks, one by one: recursion over the blocks.
void enumerate(Blocks& blocks, std::size_t block, std::vector<double>& statistics) {
  if (block == blocks.size()) {
    statistics.push_back(friedman_test(blocks).statistic);
    return;
  }
  std::vector<std::size_t> order(blocks[block].size());
  for (std::size_t i = 0; i < order.size(); ++i) order[i] = i;
  const std::vector<double> original = blocks[block];
  do {
    for (std::size_t i = 0; i < order.size(); ++i) blocks[block][i] = original[order[i]];
    enumerate(blocks, block + 1, statistics);
  } while (std::next_permutation(order.begin(), order.end()));
  blocks[block] = original;
}

TEST(Friedman, ExactCountsAllAssignments) {
  for (const Blocks& data :
       {Blocks{{1, 2, 3}, {1, 3, 2}, {1, 2, 3}, {2, 1, 3}},
        Blocks{{1, 2, 2}, {1, 1, 2}, {3, 3, 3}, {1, 2, 3}}, Blocks{{4, 1, 2, 3}, {4, 2, 1, 3}}}) {
    Blocks blocks = data;
    std::vector<double> statistics;
    enumerate(blocks, 0, statistics);
    const Friedman test = friedman_test(data);
    double extreme = 0.0;
    double mean = 0.0;
    for (const double statistic : statistics) {
      extreme += statistic >= test.statistic - 1e-9 ? 1.0 : 0.0;
      mean += statistic / static_cast<double>(statistics.size());
    }
    EXPECT_NEAR(*friedman_exact_p_value(data), extreme / static_cast<double>(statistics.size()),
                1e-12);
    EXPECT_NEAR(mean, test.degrees_of_freedom, 1e-9) << "exactly, thanks to the tie correction";
  }
}

TEST(Friedman, TakesWhatIsAllTied) {
  const Friedman tied = friedman_test(Blocks{{1, 1}, {2, 2}});
  EXPECT_EQ(tied.statistic, 0.0);
  EXPECT_EQ(tied.p_value, 1.0);
  EXPECT_EQ(*friedman_exact_p_value(Blocks{{1, 1}, {2, 2}}), 1.0);
  EXPECT_FALSE(tied.kendalls_w);
  for (const auto& comparison : friedman_post_hoc(Blocks{{1, 1}, {2, 2}})) {
    EXPECT_EQ(comparison.p_value, 1.0);
  }
  const Friedman agreed = friedman_test(Blocks{{1, 2, 3}, {4, 5, 6}});
  EXPECT_DOUBLE_EQ(*agreed.kendalls_w, 1.0);
  EXPECT_TRUE(std::isinf(*agreed.f_statistic));
  EXPECT_EQ(*agreed.f_p_value, 0.0);
  EXPECT_DOUBLE_EQ(*friedman_exact_p_value(Blocks{{1, 2, 3}, {4, 5, 6}}), 1.0 / 6.0);
  EXPECT_FALSE(friedman_test(Blocks{{1, 2}}).f_statistic);
  EXPECT_FALSE(friedman_exact_p_value(Blocks(200, {1, 2, 3, 4, 5, 6}))) << "too many to count";
}

TEST(Friedman, RefusesRaggedBlocks) {
  EXPECT_THROW(friedman_test(Blocks{}), Error);
  EXPECT_THROW(friedman_test(Blocks{{1.0}}), Error);
  EXPECT_THROW(friedman_test(Blocks{{1, 2}, {1, 2, 3}}), Error);
  EXPECT_THROW(friedman_post_hoc(Blocks{{1, std::nan("")}}), Error);
}

// Demšar compares with the first classifier: z = 2.343, 0.512 and 2.416 from SE = sqrt(4·5/(6·14)). Ties,
// which he leaves out, make the error smaller.
TEST(FriedmanPostHoc, HasTheDifferencesOfDemsar) {
  const auto comparisons = friedman_post_hoc(demsar());
  ASSERT_EQ(comparisons.size(), 6U);
  const std::vector<double> published = {2.343, 0.512, 2.416};
  for (std::size_t i = 0; i < 3; ++i) {
    const double z = comparisons[i].effect / std::sqrt(20.0 / 84.0);
    EXPECT_NEAR(z, published[i], 2e-3);
    EXPECT_LT(comparisons[i].p_value, 2.0 * normal_upper_tail(z));
  }
}

TEST(FriedmanPostHoc, WithoutTiesHasTheTextbooksError) {
  const Blocks blocks = {{1, 2, 3}, {2, 1, 3}, {1, 3, 2}, {1, 2, 3}, {1, 2, 3}};
  const auto comparisons = friedman_post_hoc(blocks);
  EXPECT_DOUBLE_EQ(comparisons[1].effect, 1.2 - 2.8);
  EXPECT_NEAR(comparisons[1].p_value, 2.0 * normal_upper_tail(1.6 / std::sqrt(12.0 / 30.0)), 1e-12);
  EXPECT_DOUBLE_EQ(comparisons[1].adjusted, 3.0 * comparisons[1].p_value);
}

TEST(Friedman, RejectsTheTruthAsOftenAsItSays) {
  Random random(23);
  constexpr int kRounds = 2000;
  int rejected = 0;
  int family = 0;
  for (int round = 0; round < kRounds; ++round) {
    Blocks blocks(100, std::vector<double>(3));
    for (auto& block : blocks) {
      const double level = 5.0 * random.normal();
      for (double& value : block) value = level + random.normal();
    }
    rejected += friedman_test(std::span(blocks)).p_value <= 0.05 ? 1 : 0;
    bool any = false;
    for (const auto& comparison : pairwise_signed_rank(blocks)) any |= comparison.adjusted <= 0.05;
    family += any ? 1 : 0;
  }
  EXPECT_NEAR(rejected / static_cast<double>(kRounds), 0.05, 0.016);
  EXPECT_LE(family / static_cast<double>(kRounds), 0.05 + 0.016);
}

// The example of pingouin's holm(): p-values (.50, .003, .32, .054, .0003) become (.64, .012, .64,
// .162, .0015).
TEST(Holm, AgreesWithPingouin) {
  const std::vector<double> p_values = {0.50, 0.003, 0.32, 0.054, 0.0003};
  EXPECT_THAT(holm_adjusted(p_values),
              Pointwise(::testing::DoubleNear(1e-15),
                        std::vector<double>{0.64, 0.012, 0.64, 0.162, 0.0015}));
}

// The example of Wikipedia, "Holm-Bonferroni method": of 0.01, 0.04, 0.03, 0.005 at 0.05 the fourth and
// the first are rejected.
TEST(Holm, RejectsStepByStep) {
  const auto adjusted = holm_adjusted(std::vector<double>{0.01, 0.04, 0.03, 0.005});
  EXPECT_THAT(adjusted,
              Pointwise(::testing::DoubleNear(1e-15), std::vector<double>{0.03, 0.06, 0.06, 0.02}));
}

TEST(Holm, KeepsTheOrderAndNeverLowers) {
  Random random(1);
  std::vector<double> p_values(30);
  for (double& p : p_values) p = random.uniform() * random.uniform();
  const auto adjusted = holm_adjusted(p_values);
  for (std::size_t i = 0; i < p_values.size(); ++i) {
    EXPECT_GE(adjusted[i], p_values[i]);
    EXPECT_LE(adjusted[i], std::min(1.0, 30.0 * p_values[i]) + 1e-15) << "at most Bonferroni's";
    for (std::size_t j = 0; j < p_values.size(); ++j) {
      EXPECT_TRUE(p_values[i] > p_values[j] || adjusted[i] <= adjusted[j]);
    }
  }
  EXPECT_TRUE(holm_adjusted({}).empty());
  EXPECT_THAT(holm_adjusted(std::vector<double>{0.2}), ElementsAre(0.2));
  EXPECT_THROW(holm_adjusted(std::vector<double>{1.2}), Error);
  EXPECT_THROW(holm_adjusted(std::vector<double>{std::nan("")}), Error);
}

TEST(PairwiseComparisons, AreTheTestsOfTwo) {
  const auto ranks = pairwise_signed_rank(rounding_times());
  ASSERT_EQ(ranks.size(), 3U);
  std::vector<double> differences;
  for (const auto& block : rounding_times()) differences.push_back(block[0] - block[2]);
  const SignedRank test = wilcoxon_signed_rank(differences);
  EXPECT_EQ(ranks[1].first, 0U);
  EXPECT_EQ(ranks[1].second, 2U);
  EXPECT_EQ(ranks[1].p_value, test.p_value);
  EXPECT_EQ(ranks[1].effect, *test.rank_biserial);
  EXPECT_GE(ranks[1].adjusted, test.p_value);

  const std::vector<std::vector<bool>> successes = {{true, true, true, true, false},
                                                    {false, true, false, false, false},
                                                    {true, true, true, true, false}};
  const auto proportions = pairwise_mcnemar(successes);
  ASSERT_EQ(proportions.size(), 3U);
  EXPECT_DOUBLE_EQ(proportions[0].p_value, mcnemar_exact({1, 3, 0, 1}));
  EXPECT_DOUBLE_EQ(proportions[0].effect, 0.8 - 0.2);
  EXPECT_EQ(proportions[1].p_value, 1.0);
  EXPECT_THROW(pairwise_mcnemar(std::vector<std::vector<bool>>{{true}}), Error);
  EXPECT_THROW(pairwise_mcnemar(std::vector<std::vector<bool>>{{true}, {}}), Error);
}

}  // namespace
}  // namespace cairn
