// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/placement/verdict.hpp"

#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace cairn {
namespace {

using ::testing::HasSubstr;

Judgement verdict_of(const std::vector<PlacementCandidate>& candidates,
                     std::size_t landmarks = 3000) {
  return judge(candidates, landmarks, 0.02);
}

PlacementCandidate candidate(double support, double chance) {
  return {.target_from_source = {}, .support = support, .chance = chance};
}

TEST(Verdict, AlignedIfClearOfChanceAndOfTheNext) {
  const Judgement judgement = verdict_of({candidate(0.4, 0.1), candidate(0.15, 0.1)});
  EXPECT_EQ(judgement.verdict, Verdict::kAligned);
  EXPECT_THAT(judgement.reason, HasSubstr("40.0 %"));
  EXPECT_THAT(judgement.reason, HasSubstr("15.0 %"));
  EXPECT_THAT(judgement.reason, HasSubstr("10.0 %"));
  EXPECT_THAT(judgement.reason, HasSubstr("3000"));
}

TEST(Verdict, AmbiguousIfAnotherIsAboutAsGoodAndBothClearOfChance) {
  const Judgement judgement = verdict_of(
      {candidate(0.4, 0.1), candidate(0.38, 0.1), candidate(0.37, 0.1), candidate(0.1, 0.1)});
  EXPECT_EQ(judgement.verdict, Verdict::kAmbiguous);
  EXPECT_THAT(judgement.reason, HasSubstr("3 poses"));
}

TEST(Verdict, RejectedIfNotClearOfChance) {
  EXPECT_EQ(verdict_of({candidate(0.12, 0.1), candidate(0.05, 0.04)}).verdict, Verdict::kRejected);
  EXPECT_EQ(verdict_of({candidate(0.12, 0.1), candidate(0.11, 0.1)}).verdict, Verdict::kRejected);
  EXPECT_EQ(verdict_of({}).verdict, Verdict::kRejected);
}

TEST(Verdict, RejectedIfFewLandmarksCouldMatchByChance) {
  const std::vector<PlacementCandidate> poses = {candidate(0.3, 0.1), candidate(0.12, 0.1)};
  EXPECT_EQ(verdict_of(poses, 3000).verdict, Verdict::kAligned);
  EXPECT_EQ(verdict_of(poses, 60).verdict, Verdict::kRejected);
}

}  // namespace
}  // namespace cairn
