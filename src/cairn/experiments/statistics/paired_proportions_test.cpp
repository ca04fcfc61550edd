// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/experiments/statistics/paired_proportions.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include <gtest/gtest.h>

#include "cairn/core/error.hpp"
#include "cairn/core/random.hpp"
#include "cairn/experiments/statistics/distributions.hpp"
#include "cairn/experiments/statistics/equivalence.hpp"

namespace cairn {
namespace {

// Approval of the president in two surveys: Agresti, "Categorical Data Analysis", 1990, p. 350; the
// example of R's mcnemar.test.
constexpr PairedCounts kApproval{794, 150, 86, 570};
// Airway hyper-responsiveness before and after a transplantation (Bentur et al. 2009), complete
// response to a therapy (Cavo et al. 2012), and the table of Ezra et al. 2010: the worked examples of
// Fagerland, Lydersen and Laake, "Statistical Analysis of Contingency Tables", 2017, chapter 8, whose
// results are those in the tests of their R package contingencytables.
constexpr PairedCounts kAirways{1, 1, 7, 12};
constexpr PairedCounts kResponse{59, 6, 16, 80};

TEST(CountPairs, SortsPairsIntoFour) {
  const PairedCounts counts = count_pairs({true, true, true, false, false, false},
                                          {true, false, false, true, false, false});
  EXPECT_EQ(counts.both, 1U);
  EXPECT_EQ(counts.first_only, 2U);
  EXPECT_EQ(counts.second_only, 1U);
  EXPECT_EQ(counts.neither, 2U);
  EXPECT_EQ(counts.first().successes, 3U);
  EXPECT_EQ(counts.second().successes, 2U);
  EXPECT_THROW(count_pairs({true}, {}), Error);
}

TEST(McNemar, AgreesWithAgresti) {
  // mcnemar.test(..., correct = FALSE): 17.3559, p = 3.099e-05. With the correction by hand: 63²/236.
  const ChiSquaredTest plain = mcnemar_chi_squared(kApproval, false);
  EXPECT_NEAR(plain.statistic, 17.3559, 5e-5);
  EXPECT_NEAR(plain.p_value, 3.099e-05, 5e-9);
  EXPECT_DOUBLE_EQ(mcnemar_chi_squared(kApproval).statistic, 63.0 * 63.0 / 236.0);
}

TEST(McNemar, AgreesWithFagerlandLydersenAndLaake) {
  EXPECT_NEAR(mcnemar_exact(kAirways), 0.0703, 5e-5);
  EXPECT_NEAR(mcnemar_mid_p(kAirways), 0.0391, 5e-5);
  EXPECT_NEAR(mcnemar_mid_p(kResponse), 0.034690, 5e-7);
}

TEST(McNemar, ExactIsTheSumOfTheTails) {
  for (std::size_t b = 0; b <= 9; ++b) {
    double tail = 0.0;
    double coefficient = 1.0;
    for (std::size_t k = 0; k <= std::min(b, 9 - b); ++k) {
      tail += coefficient / 512.0;
      coefficient *= static_cast<double>(9 - k) / static_cast<double>(k + 1);
    }
    EXPECT_NEAR(mcnemar_exact({3, b, 9 - b, 5}), std::min(1.0, 2.0 * tail), 1e-15);
    EXPECT_EQ(mcnemar_exact({3, b, 9 - b, 5}), mcnemar_exact({0, 9 - b, b, 0}));
    EXPECT_LT(mcnemar_mid_p({3, b, 9 - b, 5}), mcnemar_exact({3, b, 9 - b, 5}));
  }
}

TEST(McNemar, FindsNothingWherePairsAgree) {
  EXPECT_EQ(mcnemar_exact({5, 0, 0, 2}), 1.0);
  EXPECT_EQ(mcnemar_mid_p({5, 0, 0, 2}), 1.0);
  EXPECT_EQ(mcnemar_chi_squared({5, 0, 0, 2}).p_value, 1.0);
  EXPECT_EQ(mcnemar_chi_squared({5, 4, 4, 2}).statistic, 0.0) << "the correction goes to 0 at most";
}

TEST(PairedDifference, AgreesWithFagerlandLydersenAndLaake) {
  const auto newcombe = paired_difference(kResponse);
  ASSERT_TRUE(newcombe);
  EXPECT_NEAR(newcombe->estimate, -0.0621, 5e-5);
  EXPECT_NEAR(newcombe->interval.low, -0.1186, 5e-5);
  EXPECT_NEAR(newcombe->interval.high, -0.0046, 5e-5);
  const auto tango = paired_score_difference(kResponse);
  ASSERT_TRUE(tango);
  EXPECT_NEAR(tango->interval.low, -0.1240, 5e-5);
  EXPECT_NEAR(tango->interval.high, -0.0054, 5e-5);
}

TEST(PairedDifference, MirrorsWhenTheMethodsSwap) {
  for (const PairedCounts& counts :
       {kApproval, kAirways, kResponse, PairedCounts{0, 8, 0, 0}, PairedCounts{9, 0, 0, 1}}) {
    const PairedCounts swapped{counts.both, counts.second_only, counts.first_only, counts.neither};
    for (const auto interval : {paired_difference, paired_score_difference}) {
      const auto one = interval(counts, 0.95);
      const auto other = interval(swapped, 0.95);
      EXPECT_DOUBLE_EQ(one->estimate, -other->estimate);
      EXPECT_NEAR(one->interval.low, -other->interval.high, 1e-12);
      EXPECT_NEAR(one->interval.high, -other->interval.low, 1e-12);
      EXPECT_TRUE(one->interval.contains(one->estimate));
      EXPECT_GT(one->interval.width(), 0.0) << "even where all pairs agree";
    }
  }
  EXPECT_FALSE(paired_difference({}));
  EXPECT_FALSE(paired_score_difference({}));
  EXPECT_FALSE(paired_score_statistic({}, 0.1));
}

// With the nuisance parameter that a search finds most likely, not by the formula.
TEST(PairedScore, RestsOnTheMostLikelyNuisance) {
  const PairedCounts counts{10, 7, 3, 5};
  for (const double delta : {-0.4, -0.05, 0.0, 0.1, 0.3, 0.6}) {
    double best = 0.0;
    double most = -1e300;
    const double lowest = std::max(0.0, -delta);
    const double highest = (1.0 - delta) / 2.0;
    for (int i = 1; i < 200'000; ++i) {
      const double q = lowest + (highest - lowest) * i / 200'000.0;
      const double likelihood =
          7.0 * std::log(q + delta) + 3.0 * std::log(q) + 15.0 * std::log(1.0 - 2.0 * q - delta);
      if (likelihood > most) {
        most = likelihood;
        best = q;
      }
    }
    const double z = (4.0 - 25.0 * delta) / std::sqrt(25.0 * (2.0 * best + delta * (1.0 - delta)));
    EXPECT_NEAR(*paired_score_statistic(counts, delta), z, 1e-4) << delta;
  }
  const double at_zero = *paired_score_statistic(counts, 0.0);
  EXPECT_NEAR(at_zero * at_zero, mcnemar_chi_squared(counts, false).statistic, 1e-12);
  EXPECT_THROW(paired_score_statistic(counts, 1.0), Error);
}

TEST(PairedScore, IsTheBoundaryOfItsInterval) {
  for (const PairedCounts& counts : {kAirways, kResponse, PairedCounts{9, 0, 0, 1}}) {
    const Interval interval = paired_score_difference(counts, 0.9)->interval;
    const double z = normal_two_sided_quantile(0.9);
    EXPECT_NEAR(*paired_score_statistic(counts, interval.low), z, 1e-6);
    EXPECT_NEAR(*paired_score_statistic(counts, interval.high), -z, 1e-6);
  }
}

TEST(PairedDifference, CoversAsOftenAsItSays) {
  Random random(7);
  constexpr int kRounds = 4000;
  int newcombe = 0;
  int tango = 0;
  for (int round = 0; round < kRounds; ++round) {
    PairedCounts counts;
    for (int i = 0; i < 60; ++i) {
      const double u = random.uniform();
      if (u < 0.5) {
        ++counts.both;
      } else if (u < 0.7) {
        ++counts.first_only;
      } else if (u < 0.78) {
        ++counts.second_only;
      } else {
        ++counts.neither;
      }
    }
    newcombe += paired_difference(counts)->interval.contains(0.12) ? 1 : 0;
    tango += paired_score_difference(counts)->interval.contains(0.12) ? 1 : 0;
  }
  EXPECT_NEAR(newcombe / static_cast<double>(kRounds), 0.95, 0.015);
  EXPECT_NEAR(tango / static_cast<double>(kRounds), 0.95, 0.015);
}

TEST(DiscordantOdds, AgreeWithFagerlandLydersenAndLaake) {
  // Conditional odds ratio 12.5000, Clopper-Pearson transformed: 3.1169 to 108.8892.
  const auto odds = discordant_odds({0, 25, 2, 0});
  ASSERT_TRUE(odds);
  EXPECT_DOUBLE_EQ(odds->ratio, 12.5);
  EXPECT_NEAR(odds->interval.low, 3.1169, 5e-5);
  EXPECT_NEAR(odds->interval.high, 108.8892, 5e-5);
  const auto inverse = discordant_odds({0, 2, 25, 0});
  EXPECT_NEAR(inverse->interval.low, 1.0 / odds->interval.high, 1e-12);
}

TEST(DiscordantOdds, MayBeInfinite) {
  const auto odds = discordant_odds({4, 6, 0, 1});
  ASSERT_TRUE(odds);
  EXPECT_TRUE(std::isinf(odds->ratio));
  EXPECT_TRUE(std::isinf(odds->interval.high));
  EXPECT_GT(odds->interval.low, 0.0);
  EXPECT_EQ(discordant_odds({4, 0, 6, 1})->ratio, 0.0);
  EXPECT_FALSE(discordant_odds({4, 0, 0, 1}));
}

TEST(TostPairedProportions, SaysWhatItsIntervalSays) {
  for (std::size_t b = 0; b <= 12; b += 3) {
    for (std::size_t c = 0; c <= 12; c += 2) {
      const PairedCounts counts{60, b, c, 15};
      const auto test = tost_paired_proportions(counts, 0.1);
      ASSERT_TRUE(test);
      const bool inside = test->interval.low > -0.1 && test->interval.high < 0.1;
      EXPECT_EQ(test->equivalent, inside) << b << " and " << c;
      EXPECT_EQ(test->p_value, std::max(test->p_low, test->p_high));
    }
  }
}

// Without discordant pairs q is 0 below 0 and z = nΔ/sqrt(n·Δ(1-Δ)) = sqrt(nΔ/(1-Δ)), by hand.
TEST(TostPairedProportions, TakesPerfectAgreementForWhatItIs) {
  const auto many = tost_paired_proportions({90, 0, 0, 10}, 0.05);
  ASSERT_TRUE(many);
  EXPECT_NEAR(many->statistic_low, std::sqrt(100.0 * 0.05 / 0.95), 1e-12);
  EXPECT_TRUE(many->equivalent);
  EXPECT_FALSE(tost_paired_proportions({9, 0, 0, 1}, 0.05)->equivalent) << "too few to tell";
  EXPECT_FALSE(tost_paired_proportions({}, 0.05));
  EXPECT_THROW(tost_paired_proportions({}, 0.0), Error);
  EXPECT_THROW(tost_paired_proportions({}, 0.1, 0.5), Error);
}

// At the border of the margin, where the hypothesis is just true, it is rejected as often as α says.
TEST(TostPairedProportions, HoldsItsLevelAtTheMargin) {
  Random random(3);
  constexpr int kRounds = 4000;
  int rejected = 0;
  for (int round = 0; round < kRounds; ++round) {
    PairedCounts counts;
    for (int i = 0; i < 200; ++i) {
      const double u = random.uniform();
      ++(u < 0.6
             ? counts.both
             : (u < 0.75 ? counts.first_only : (u < 0.8 ? counts.second_only : counts.neither)));
    }
    rejected += tost_paired_proportions(counts, 0.1)->equivalent ? 1 : 0;
  }
  EXPECT_NEAR(rejected / static_cast<double>(kRounds), 0.05, 0.012);
}

// R's sleep data, group 1 - group 2 (Student 1908), with bounds of -1 and 1, as TOSTER's t_TOST
// reports it: t(9) = -1.491161 and -6.633095, p = 9.149441e-01 and 4.778596e-05, 90 % interval
// -2.293005 to -0.8669947.
TEST(TostPairedMeans, AgreesWithToster) {
  const std::vector<double> differences = {-1.2, -2.4, -1.3, -1.3, 0.0,
                                           -1.0, -1.8, -0.8, -4.6, -1.4};
  const auto test = tost_paired_means(differences, {-1.0, 1.0});
  ASSERT_TRUE(test);
  EXPECT_NEAR(test->estimate, -1.58, 1e-12);
  EXPECT_NEAR(test->statistic_low, -1.491161, 5e-7);
  EXPECT_NEAR(test->statistic_high, -6.633095, 5e-7);
  EXPECT_NEAR(test->p_low, 9.149441e-01, 5e-8);
  EXPECT_NEAR(test->p_high, 4.778596e-05, 5e-12);
  EXPECT_NEAR(test->interval.low, -2.293005, 5e-7);
  EXPECT_NEAR(test->interval.high, -0.8669947, 5e-8);
  EXPECT_FALSE(test->equivalent);
}

TEST(TostPairedMeans, SaysWhatItsIntervalSays) {
  for (const double mean : {-0.3, -0.1, 0.0, 0.2, 0.45}) {
    for (const double alpha : {0.01, 0.05, 0.2}) {
      const auto test = tost_paired_means(DifferenceSummary{20, mean, 0.6}, {-0.5, 0.4}, alpha);
      ASSERT_TRUE(test);
      EXPECT_EQ(test->equivalent, test->interval.low > -0.5 && test->interval.high < 0.4);
    }
  }
}

TEST(TostPairedMeans, NeedsNoVariance) {
  const std::vector<double> equal(5, 0.1);
  EXPECT_TRUE(tost_paired_means(equal, {-0.2, 0.2})->equivalent);
  EXPECT_FALSE(tost_paired_means(equal, {-0.1, 0.1})->equivalent) << "on the border is not within";
  EXPECT_FALSE(tost_paired_means(equal, {-0.1, 0.05})->equivalent);
  EXPECT_FALSE(tost_paired_means(std::vector<double>{0.1}, {-0.2, 0.2}));
  EXPECT_THROW(tost_paired_means(equal, {0.2, -0.2}), Error);
  EXPECT_THROW(tost_paired_means(equal, {-0.2, 0.2}, 0.7), Error);
  EXPECT_THROW(tost_paired_means(DifferenceSummary{3, 0.0, -1.0}, {-1.0, 1.0}), Error);
}

}  // namespace
}  // namespace cairn
