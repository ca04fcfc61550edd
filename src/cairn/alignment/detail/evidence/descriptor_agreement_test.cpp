// SPDX-License-Identifier: BSD-3-Clause
#include <cmath>

#include <gtest/gtest.h>

#include "cairn/alignment/alignment.hpp"

namespace cairn::detail {
namespace {

TEST(DescriptorAgreement, EvidenceIsThatOfAPoissonCount) {
  const DescriptorAgreement agreement{
      .matches = 300, .agreeing = 14, .spread = 12, .expected = 2.0};
  const auto log_probability = [](double count, double mean) {
    return count * std::log(mean) - mean - std::lgamma(count + 1.0);
  };
  EXPECT_NEAR(agreement.evidence(), log_probability(12.0, 12.0) - log_probability(12.0, 2.0), 1e-9);
}

TEST(DescriptorAgreement, NoMoreThanChanceIsNoEvidence) {
  EXPECT_EQ((DescriptorAgreement{300, 9, 2, 2.0}.evidence()), 0.0);
  EXPECT_EQ(DescriptorAgreement{}.evidence(), 0.0);
}

TEST(DescriptorAgreement, CountsWhatIsSpreadAndGrowsWithIt) {
  EXPECT_EQ((DescriptorAgreement{300, 40, 8, 0.5}.evidence()),
            (DescriptorAgreement{300, 9, 8, 0.5}.evidence()));
  EXPECT_LT((DescriptorAgreement{300, 9, 8, 0.5}.evidence()),
            (DescriptorAgreement{300, 9, 9, 0.5}.evidence()));
  // A few pairs drawn at random do not show that chance gives none at all: at least a quarter of a match counts.
  const double of_a_quarter = 8.0 * std::log(8.0 / 0.25) - (8.0 - 0.25);
  for (const double expected : {0.0, 0.2, 0.25}) {
    EXPECT_NEAR((DescriptorAgreement{300, 9, 8, expected}.evidence()), of_a_quarter, 1e-12);
  }
  EXPECT_LT((DescriptorAgreement{300, 9, 8, 0.3}.evidence()), of_a_quarter);
}

}  // namespace
}  // namespace cairn::detail
