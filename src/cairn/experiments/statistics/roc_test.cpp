// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/experiments/statistics/roc.hpp"

#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

#include <gtest/gtest.h>

#include "cairn/core/error.hpp"
#include "cairn/core/random.hpp"
#include "cairn/experiments/statistics/effect_size.hpp"

namespace cairn {
namespace {

struct Judged {
  std::vector<double> scores;
  std::vector<bool> success;

  void add(double score, bool succeeded, int times = 1) {
    for (int i = 0; i < times; ++i) {
      scores.push_back(score);
      success.push_back(succeeded);
    }
  }
};

// Ratings of 58 normal and 51 abnormal images: Hanley and McNeil, Radiology 143, 29-36 (1982), table
// I. Area 0.893 with a standard error of 0.032.
TEST(Roc, AgreesWithHanleyAndMcNeil) {
  constexpr std::array<int, 5> kNormal = {33, 6, 6, 11, 2};
  constexpr std::array<int, 5> kAbnormal = {3, 2, 2, 11, 33};
  Judged ratings;
  for (std::size_t i = 0; i < 5; ++i) {
    ratings.add(static_cast<double>(i + 1), false, kNormal[i]);
    ratings.add(static_cast<double>(i + 1), true, kAbnormal[i]);
  }
  const auto roc = roc_analysis(ratings.scores, ratings.success, ScoreMeaning::kHigherIsBetter);
  ASSERT_TRUE(roc);
  EXPECT_EQ(roc->successes, 51U);
  EXPECT_EQ(roc->failures, 58U);
  EXPECT_NEAR(roc->auc, 0.893, 5e-4);
  EXPECT_NEAR(roc->hanley_mcneil_standard_error, 0.032, 1e-3);
  EXPECT_NEAR(*roc->delong_standard_error, 0.032, 2e-3) << "theirs is another, yet near";
  EXPECT_TRUE(roc->delong_interval->contains(roc->auc));
  EXPECT_TRUE(roc->score_interval.contains(roc->auc));
}

Judged random_trials(Random& random, int successes, int failures, double shift, bool ties) {
  Judged judged;
  for (int i = 0; i < successes + failures; ++i) {
    const bool succeeded = i < successes;
    const double score = random.normal() + (succeeded ? shift : 0.0);
    judged.add(ties ? std::round(score) : score, succeeded);
  }
  return judged;
}

// DeLong's by its definition: the variances of the shares of the other kind that each trial beats.
TEST(Roc, CountsAllPairs) {
  Random random(5);
  for (const bool ties : {false, true}) {
    const Judged judged = random_trials(random, 12, 17, 0.7, ties);
    std::vector<double> of_successes(12, 0.0);
    std::vector<double> of_failures(17, 0.0);
    double auc = 0.0;
    for (std::size_t i = 0; i < 12; ++i) {
      for (std::size_t j = 0; j < 17; ++j) {
        const double x = judged.scores[i];
        const double y = judged.scores[12 + j];
        const double kernel = x > y ? 1.0 : (x == y ? 0.5 : 0.0);
        of_successes[i] += kernel / 17.0;
        of_failures[j] += kernel / 12.0;
        auc += kernel / (12.0 * 17.0);
      }
    }
    double s10 = 0.0;
    double s01 = 0.0;
    for (const double share : of_successes) s10 += (share - auc) * (share - auc) / 11.0;
    for (const double share : of_failures) s01 += (share - auc) * (share - auc) / 16.0;
    const auto roc = roc_analysis(judged.scores, judged.success, ScoreMeaning::kHigherIsBetter);
    EXPECT_NEAR(roc->auc, auc, 1e-12);
    EXPECT_NEAR(*roc->delong_standard_error, std::sqrt(s10 / 12.0 + s01 / 17.0), 1e-12);

    // The area under the curve as drawn, by trapezoids, is the same.
    double area = 0.0;
    for (std::size_t i = 1; i < roc->curve.size(); ++i) {
      const RocPoint& a = roc->curve[i - 1];
      const RocPoint& b = roc->curve[i];
      area += (a.specificity - b.specificity) * (a.sensitivity + b.sensitivity) / 2.0;
    }
    EXPECT_NEAR(area, auc, 1e-12);

    const std::vector<double> good(judged.scores.begin(), judged.scores.begin() + 12);
    const std::vector<double> bad(judged.scores.begin() + 12, judged.scores.end());
    EXPECT_NEAR(cliffs_delta(good, bad)->vargha_delaney_a, auc, 1e-12)
        << "the same by another name";

    std::vector<double> negated;
    for (const double score : judged.scores) negated.push_back(-score);
    const auto mirrored = roc_analysis(negated, judged.success, ScoreMeaning::kLowerIsBetter);
    EXPECT_EQ(mirrored->auc, roc->auc);
    EXPECT_EQ(mirrored->best.threshold, -roc->best.threshold);
    EXPECT_NEAR(roc_analysis(judged.scores, judged.success, ScoreMeaning::kLowerIsBetter)->auc,
                1.0 - auc, 1e-12);
  }
}

TEST(Roc, FindsTheBestThreshold) {
  const std::vector<double> scores = {0.001, 0.002, 0.003, 0.004, 0.006, 0.008};
  const std::vector<bool> success = {true, true, true, false, true, false};
  const auto roc = roc_analysis(scores, success, ScoreMeaning::kLowerIsBetter);
  ASSERT_TRUE(roc);
  EXPECT_EQ(roc->best.threshold, 0.003);
  EXPECT_DOUBLE_EQ(roc->best.sensitivity, 0.75);
  EXPECT_DOUBLE_EQ(roc->best.specificity, 1.0);
  EXPECT_EQ(roc->curve.size(), 7U);
  EXPECT_EQ(roc->curve.front().threshold, -std::numeric_limits<double>::infinity());
  EXPECT_EQ(roc->curve.back().sensitivity, 1.0);
  EXPECT_EQ(roc->curve.back().specificity, 0.0);
}

TEST(Roc, IsUnsureOfAPerfectScore) {
  const std::vector<double> scores = {1, 2, 3, 8, 9};
  const std::vector<bool> success = {false, false, false, true, true};
  const auto roc = roc_analysis(scores, success, ScoreMeaning::kHigherIsBetter);
  EXPECT_EQ(roc->auc, 1.0);
  EXPECT_FALSE(roc->delong_interval);
  EXPECT_EQ(roc->score_interval.high, 1.0);
  EXPECT_LT(roc->score_interval.low, 0.9);
  EXPECT_GT(roc->score_interval.low, 0.2);
  const auto useless =
      roc_analysis(std::vector<double>(5, 1.0), success, ScoreMeaning::kLowerIsBetter);
  EXPECT_EQ(useless->auc, 0.5);
  EXPECT_EQ(useless->curve.size(), 2U);
  const auto wrong = roc_analysis(scores, success, ScoreMeaning::kLowerIsBetter);
  EXPECT_EQ(wrong->auc, 0.0);
  EXPECT_EQ(wrong->score_interval.low, 0.0);
}

TEST(Roc, NeedsBothKinds) {
  const std::vector<double> scores = {1, 2};
  EXPECT_FALSE(roc_analysis(scores, {true, true}, ScoreMeaning::kHigherIsBetter));
  EXPECT_FALSE(roc_analysis({}, {}, ScoreMeaning::kHigherIsBetter));
  EXPECT_FALSE(
      roc_analysis(scores, {true, false}, ScoreMeaning::kHigherIsBetter)->delong_standard_error);
  EXPECT_THROW(roc_analysis(scores, {true}, ScoreMeaning::kHigherIsBetter), Error);
  EXPECT_THROW(
      roc_analysis(std::vector<double>{std::nan("")}, {true}, ScoreMeaning::kHigherIsBetter),
      Error);
  const std::vector<double> infinite = {std::numeric_limits<double>::infinity(), 1.0};
  EXPECT_EQ(roc_analysis(infinite, {false, true}, ScoreMeaning::kLowerIsBetter)->auc, 1.0)
      << "a failed alignment's score";
}

TEST(Roc, CoversAsOftenAsItSays) {
  // The area between normal distributions a shift apart is Φ(shift/√2).
  const double truth = 0.5 * std::erfc(-1.0 / 2.0);
  Random random(8);
  constexpr int kRounds = 3000;
  int delong = 0;
  int score = 0;
  for (int round = 0; round < kRounds; ++round) {
    const Judged judged = random_trials(random, 40, 50, 1.0, false);
    const auto roc = roc_analysis(judged.scores, judged.success, ScoreMeaning::kHigherIsBetter);
    delong += roc->delong_interval->contains(truth) ? 1 : 0;
    score += roc->score_interval.contains(truth) ? 1 : 0;
  }
  EXPECT_NEAR(delong / static_cast<double>(kRounds), 0.945, 0.016);
  EXPECT_NEAR(score / static_cast<double>(kRounds), 0.95, 0.016);
}

}  // namespace
}  // namespace cairn
