// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/experiments/statistics/signed_rank.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <gtest/gtest.h>

#include "cairn/core/error.hpp"
#include "cairn/core/random.hpp"
#include "cairn/experiments/statistics/ranks.hpp"

namespace cairn {
namespace {

// Depression before and after a tranquilizer: Hollander and Wolfe (1973), pp. 29 f., the example of
// R's wilcox.test.
std::vector<double> depression() {
  const std::vector<double> x = {1.83, 0.50, 1.62, 2.48, 1.68, 1.88, 1.55, 3.06, 1.30};
  const std::vector<double> y = {0.878, 0.647, 0.598, 2.05, 1.06, 1.29, 1.06, 3.14, 1.29};
  std::vector<double> differences;
  for (std::size_t i = 0; i < x.size(); ++i) differences.push_back(x[i] - y[i]);
  return differences;
}

TEST(WilcoxonSignedRank, AgreesWithHollanderAndWolfe) {
  const SignedRank test =
      wilcoxon_signed_rank(depression(), {.alternative = Alternative::kGreater});
  EXPECT_TRUE(test.exact);
  EXPECT_EQ(test.positive_rank_sum, 40.0);
  EXPECT_EQ(test.negative_rank_sum, 5.0);
  EXPECT_DOUBLE_EQ(test.p_value, 0.01953125);
  EXPECT_DOUBLE_EQ(wilcoxon_signed_rank(depression()).p_value, 0.0390625);
  EXPECT_DOUBLE_EQ(wilcoxon_signed_rank(depression(), {.alternative = Alternative::kLess}).p_value,
                   1.0 - 0.01953125 + 1.0 / 512.0 * 3.0)
      << "P(V <= 40): three subsets of 1 to 9 sum to 5";
}

// The differences in height of cross- and self-fertilised maize (Darwin 1876), the example of scipy's
// stats.wilcoxon: statistic 24, p 0.041259765625; "greater": 96, 0.020629882812500.
TEST(WilcoxonSignedRank, AgreesWithScipy) {
  const std::vector<double> maize = {6, 8, 14, 16, 23, 24, 28, 29, 41, -48, 49, 56, 60, -67, 75};
  const SignedRank test = wilcoxon_signed_rank(maize);
  EXPECT_EQ(test.negative_rank_sum, 24.0);
  EXPECT_EQ(test.positive_rank_sum, 96.0);
  EXPECT_DOUBLE_EQ(test.p_value, 0.041259765625);
  EXPECT_DOUBLE_EQ(wilcoxon_signed_rank(maize, {.alternative = Alternative::kGreater}).p_value,
                   0.0206298828125);
}

// The example of Wikipedia, "Wilcoxon signed-rank test": one zero left out, one tie, rank sums 27 and
// 18, whose difference over 45 is the rank-biserial correlation.
TEST(WilcoxonSignedRank, LeavesZerosOutAndSharesRanks) {
  const std::vector<double> differences = {15, -7, 5, 20, 0, -9, 17, -12, 5, -10};
  const SignedRank test = wilcoxon_signed_rank(differences);
  EXPECT_EQ(test.used, 9U);
  EXPECT_EQ(test.zeros, 1U);
  EXPECT_TRUE(test.ties);
  EXPECT_FALSE(test.exact);
  EXPECT_EQ(test.positive_rank_sum, 27.0);
  EXPECT_EQ(test.negative_rank_sum, 18.0);
  EXPECT_DOUBLE_EQ(*test.rank_biserial, 9.0 / 45.0);
  // By hand: (27 - 22.5 - 0.5) / sqrt(9·10·19/24 - (8 - 2)/48).
  EXPECT_DOUBLE_EQ(*test.z, 4.0 / std::sqrt(71.25 - 0.125));
  const SignedRank plain = wilcoxon_signed_rank(differences, {.continuity_correction = false});
  EXPECT_DOUBLE_EQ(*plain.z, 4.5 / std::sqrt(71.25 - 0.125));
}

// All assignments of signs to the ranks, one by one.
double enumerated(const std::vector<double>& differences, Alternative alternative) {
  std::vector<double> sizes;
  for (const double d : differences) sizes.push_back(std::abs(d));
  const std::vector<double> ranks = mid_ranks(sizes).values;
  double observed = 0.0;
  for (std::size_t i = 0; i < ranks.size(); ++i) observed += differences[i] > 0 ? ranks[i] : 0.0;
  double less = 0.0;
  double greater = 0.0;
  const std::uint32_t all = 1U << ranks.size();
  for (std::uint32_t signs = 0; signs < all; ++signs) {
    double sum = 0.0;
    for (std::size_t i = 0; i < ranks.size(); ++i) sum += ((signs >> i) & 1U) != 0 ? ranks[i] : 0.0;
    less += sum <= observed ? 1.0 / all : 0.0;
    greater += sum >= observed ? 1.0 / all : 0.0;
  }
  if (alternative == Alternative::kLess) return less;
  if (alternative == Alternative::kGreater) return greater;
  return std::min(1.0, 2.0 * std::min(less, greater));
}

TEST(WilcoxonSignedRank, ExactCountsAllSigns) {
  Random random(5);
  for (std::size_t n = 1; n <= 12; ++n) {
    for (const bool ties : {false, true}) {
      std::vector<double> differences;
      for (std::size_t i = 0; i < n; ++i) {
        const double d = random.normal() + 0.3;
        differences.push_back(ties ? (d > 0 ? std::ceil(2.0 * d) : std::floor(2.0 * d)) : d);
      }
      for (const auto alternative :
           {Alternative::kTwoSided, Alternative::kLess, Alternative::kGreater}) {
        const SignedRank test = wilcoxon_signed_rank(
            differences, {.alternative = alternative, .method = PValueMethod::kExact});
        EXPECT_NEAR(test.p_value, enumerated(differences, alternative), 1e-12) << n;
      }
    }
  }
}

TEST(WilcoxonSignedRank, ApproximationIsClose) {
  Random random(11);
  for (int round = 0; round < 20; ++round) {
    std::vector<double> differences(40);
    for (double& d : differences) d = random.normal() + 0.25;
    const double exact = wilcoxon_signed_rank(differences).p_value;
    const double near =
        wilcoxon_signed_rank(differences, {.method = PValueMethod::kAsymptotic}).p_value;
    EXPECT_NEAR(near, exact, 0.005);
  }
}

TEST(WilcoxonSignedRank, IsSymmetric) {
  std::vector<double> differences = depression();
  const SignedRank test = wilcoxon_signed_rank(differences);
  for (double& d : differences) d = -3.0 * d;
  const SignedRank mirrored = wilcoxon_signed_rank(differences);
  EXPECT_EQ(mirrored.p_value, test.p_value);
  EXPECT_EQ(*mirrored.rank_biserial, -*test.rank_biserial);
  EXPECT_EQ(mirrored.positive_rank_sum, test.negative_rank_sum);
}

TEST(WilcoxonSignedRank, TakesWhatHasNoDifference) {
  EXPECT_EQ(wilcoxon_signed_rank({}).p_value, 1.0);
  const SignedRank zeros = wilcoxon_signed_rank(std::vector<double>{0.0, -0.0});
  EXPECT_EQ(zeros.p_value, 1.0);
  EXPECT_EQ(zeros.zeros, 2U);
  EXPECT_FALSE(zeros.rank_biserial);
  EXPECT_EQ(wilcoxon_signed_rank(std::vector<double>{2.0}).p_value, 1.0);
  const std::vector<double> tied(30, 1.0);
  EXPECT_LT(wilcoxon_signed_rank(tied).p_value, 1e-6);
  EXPECT_DOUBLE_EQ(wilcoxon_signed_rank(tied, {.method = PValueMethod::kExact}).p_value, 0x1p-29);
  EXPECT_THROW(wilcoxon_signed_rank(std::vector<double>{std::nan("")}), Error);
  EXPECT_THROW(
      wilcoxon_signed_rank(std::vector<double>(501, 1.0), {.method = PValueMethod::kExact}), Error);
}

TEST(WilcoxonSignedRank, RejectsTheTruthAsOftenAsItSays) {
  Random random(2);
  int rejected = 0;
  constexpr int kRounds = 4000;
  for (int round = 0; round < kRounds; ++round) {
    std::vector<double> differences(60);
    for (double& d : differences) d = random.uniform(-1.0, 1.0);
    rejected += wilcoxon_signed_rank(differences).p_value <= 0.05 ? 1 : 0;
  }
  EXPECT_NEAR(rejected / static_cast<double>(kRounds), 0.05, 0.012);
}

// Hollander and Wolfe's estimate of the shift is 0.46, the interval of 96.1 % from 0.010 to 0.786
// (examples 3.3 and 3.4; their differences have the opposite sign).
TEST(HodgesLehmann, AgreesWithHollanderAndWolfe) {
  const auto shift = hodges_lehmann(depression());
  ASSERT_TRUE(shift);
  EXPECT_NEAR(shift->estimate, 0.46, 5e-3);
  EXPECT_NEAR(shift->confidence, 0.961, 5e-4);
  EXPECT_NEAR(shift->interval.low, 0.010, 5e-4);
  EXPECT_NEAR(shift->interval.high, 0.786, 5e-4);
}

// The interval holds those shifts that the exact test does not reject.
TEST(HodgesLehmann, InvertsTheTest) {
  const auto shift = hodges_lehmann(depression(), 0.9);
  const auto p_value = [&](double by) {
    std::vector<double> shifted = depression();
    for (double& d : shifted) d -= by;
    return wilcoxon_signed_rank(shifted).p_value;
  };
  EXPECT_GT(p_value(shift->interval.low + 1e-6), 1.0 - shift->confidence);
  EXPECT_LE(p_value(shift->interval.low - 1e-6), 1.0 - shift->confidence + 1e-12);
  EXPECT_GT(p_value(shift->interval.high - 1e-6), 1.0 - shift->confidence);
  EXPECT_LE(p_value(shift->interval.high + 1e-6), 1.0 - shift->confidence + 1e-12);
}

TEST(HodgesLehmann, SaysHowSureFewDifferencesAre) {
  const auto few = hodges_lehmann(std::vector<double>{1.0, 2.0, 4.0});
  EXPECT_DOUBLE_EQ(few->estimate, 2.25) << "of 1, 1.5, 2, 2.5, 3, 4";
  EXPECT_DOUBLE_EQ(few->confidence, 0.75) << "all that three can give";
  EXPECT_EQ(few->interval.low, 1.0);
  EXPECT_EQ(few->interval.high, 4.0);
  EXPECT_FALSE(hodges_lehmann({}));
  EXPECT_EQ(hodges_lehmann(std::vector<double>(80, 0.3))->interval.width(), 0.0);
  EXPECT_THROW(hodges_lehmann(std::vector<double>(10'001, 0.3)), Error);
}

TEST(HodgesLehmann, CoversAsOftenAsItSays) {
  Random random(17);
  constexpr int kRounds = 1500;
  for (const std::size_t n : {std::size_t{20}, std::size_t{60}}) {
    double nominal = 0.0;
    int covered = 0;
    for (int round = 0; round < kRounds; ++round) {
      std::vector<double> differences(n);
      for (double& d : differences) d = 1.0 + random.normal();
      const auto shift = hodges_lehmann(differences);
      covered += shift->interval.contains(1.0) ? 1 : 0;
      nominal = shift->confidence;
    }
    EXPECT_NEAR(covered / static_cast<double>(kRounds), nominal, 0.018) << n;
  }
}

}  // namespace
}  // namespace cairn
