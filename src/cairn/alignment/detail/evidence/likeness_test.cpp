// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "cairn/alignment/alignment.hpp"

namespace cairn::detail {
namespace {

// Of all shares of alike pairs, the likeliest against that of chance.
TEST(Likeness, EvidenceIsTheLikelihoodRatioOfTheLikeliestShare) {
  constexpr double kChance = Likeness::kChance;
  for (const Likeness likeness : {Likeness{200, 3}, {200, 20}, {200, 150}, {200, 200}, {7, 2}}) {
    const auto all = static_cast<double>(likeness.compared);
    const auto alike = static_cast<double>(likeness.alike);
    double best = 0.0;
    for (double share = kChance; share < 1.0; share += 1e-5) {
      best = std::max(best, alike * std::log(share / kChance) +
                                (all - alike) * std::log((1.0 - share) / (1.0 - kChance)));
    }
    EXPECT_NEAR(likeness.evidence(), best, 1e-2) << likeness.alike;
  }
}

TEST(Likeness, CountsAddUpAndAreTakenAway) {
  Likeness all{10, 4};
  all += Likeness{3, 1};
  EXPECT_EQ(all.compared, 13U);
  EXPECT_EQ(all.alike, 5U);
  const Likeness rest = all - Likeness{6, 2};
  EXPECT_EQ(rest.compared, 7U);
  EXPECT_EQ(rest.alike, 3U);
}

TEST(Likeness, OfChanceOrLessIsNoEvidence) {
  EXPECT_EQ(Likeness().evidence(), 0.0);
  EXPECT_EQ((Likeness{640, 10}).evidence(), 0.0);
  EXPECT_EQ((Likeness{640, 0}).evidence(), 0.0);
}

}  // namespace
}  // namespace cairn::detail
