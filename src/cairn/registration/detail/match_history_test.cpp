// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/registration/detail/match_history.hpp"

#include <gtest/gtest.h>

namespace cairn::detail {
namespace {

using Matches = std::vector<Match>;

TEST(MatchHistory, KnowsNoCycleAmongDifferentMatches) {
  MatchHistory history;
  EXPECT_FALSE(history.add(Matches{{0, 1, 0.5}, {1, 2, 0.5}}));
  EXPECT_FALSE(history.add(Matches{{0, 2, 0.5}, {1, 1, 0.5}})) << "other pairs";
  EXPECT_FALSE(history.add(Matches{{2, 1, 0.5}, {3, 2, 0.5}})) << "of other sources";
  EXPECT_FALSE(history.add(Matches{{0, 1, 0.5}})) << "fewer";
  EXPECT_FALSE(history.add(Matches{}));
}

TEST(MatchHistory, KnowsAFixedPoint) {
  MatchHistory history;
  history.add(Matches{{0, 0, 1.0}});
  history.add(Matches{{0, 1, 0.9}});
  const auto cycle = history.add(Matches{{0, 1, 0.1}});
  ASSERT_TRUE(cycle) << "distances do not count";
  EXPECT_EQ(cycle->first, 2);
  EXPECT_EQ(cycle->length, 1);
}

TEST(MatchHistory, KnowsWhereACycleBegan) {
  MatchHistory history;
  for (std::uint32_t target = 0; target < 5; ++target) history.add(Matches{{0, target, 1.0}});
  const auto cycle = history.add(Matches{{0, 2, 1.0}});
  ASSERT_TRUE(cycle);
  EXPECT_EQ(cycle->first, 3);
  EXPECT_EQ(cycle->length, 3);
}

}  // namespace
}  // namespace cairn::detail
