// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/core/execution.hpp"

#include <atomic>
#include <stdexcept>
#include <vector>

#include <gtest/gtest.h>

#include "cairn/core/error.hpp"

namespace cairn {
namespace {

TEST(Executor, VisitsEachItemOnce) {
  for (const unsigned threads : {1U, 2U, 5U}) {
    std::vector<std::atomic<int>> visits(1003);
    Executor(threads).for_blocks(visits.size(), 10, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) ++visits[i];
    });
    for (const auto& count : visits) EXPECT_EQ(count, 1);
  }
}

TEST(Executor, CutsTheSameBlocksWithAnyNumberOfThreads) {
  for (const unsigned threads : {1U, 3U}) {
    std::vector<std::size_t> ends(11, 0);
    Executor(threads).for_blocks(
        103, 10, [&](std::size_t begin, std::size_t end) { ends[begin / 10] = end; });
    EXPECT_EQ(ends.front(), 10U);
    EXPECT_EQ(ends.back(), 103U);
  }
}

TEST(Executor, DoesNothingForNothing) {
  Executor(2).for_blocks(0, 8, [](std::size_t, std::size_t) { FAIL(); });
}

TEST(Executor, PassesOnWhatTheBodyThrows) {
  for (const unsigned threads : {1U, 2U}) {
    EXPECT_THROW(Executor(threads).for_blocks(100, 1,
                                              [](std::size_t begin, std::size_t) {
                                                if (begin == 57) throw std::runtime_error("57");
                                              }),
                 std::runtime_error);
  }
}

TEST(Executor, RefusesEmptyBlocks) {
  EXPECT_THROW(Executor().for_blocks(1, 0, [](std::size_t, std::size_t) {}), Error);
}

TEST(Executor, TakesOneThreadPerCoreForZero) {
  EXPECT_GE(Executor(0).threads(), 1U);
}

TEST(Executor, UsesItemsInOrderWhicheverIsMadeFirst) {
  for (const unsigned threads : {1U, 2U, 5U}) {
    std::vector<std::size_t> used;
    Executor(threads).in_order(
        200, 4, [](std::size_t i) { return std::vector<std::size_t>(i % 7 * 1000 + 1, i); },
        [&](std::size_t i, std::vector<std::size_t> item) {
          EXPECT_EQ(item.back(), i);
          used.push_back(i);
        });
    ASSERT_EQ(used.size(), 200U);
    for (std::size_t i = 0; i < used.size(); ++i) EXPECT_EQ(used[i], i);
  }
}

TEST(Executor, MakesNoMoreItemsAheadThanAsked) {
  std::atomic<int> made = 0;
  std::atomic<int> used = 0;
  std::atomic<int> most = 0;
  Executor(0).in_order(
      300, 3,
      [&](std::size_t i) {
        const int ahead = ++made - used;
        for (int seen = most; ahead > seen && !most.compare_exchange_weak(seen, ahead);) continue;
        return i;
      },
      [&](std::size_t, std::size_t) { ++used; });
  EXPECT_EQ(used, 300);
  EXPECT_LE(most, 5);
}

TEST(Executor, PassesOnWhatMakingAndUsingThrow) {
  for (const unsigned threads : {1U, 2U}) {
    const Executor executor(threads);
    const auto number = [](std::size_t i) { return i; };
    const auto refuse = [](std::size_t i, std::size_t) {
      if (i == 20) throw std::runtime_error("20");
    };
    EXPECT_THROW(executor.in_order(100, 4, number, refuse), std::runtime_error);
    const auto fail = [](std::size_t i) {
      if (i == 30) throw std::runtime_error("30");
      return i;
    };
    std::size_t used = 0;
    EXPECT_THROW(executor.in_order(100, 4, fail, [&](std::size_t, std::size_t) { ++used; }),
                 std::runtime_error);
    EXPECT_LE(used, 30U);
  }
}

TEST(Execution, TellsTheWholeProgressOfAStage) {
  std::vector<double> shares;
  const Execution whole{.progress = [&](double share) { shares.push_back(share); }, .seed = 7};
  const Execution stage = whole.stage(0.5, 1.0);
  for (const double share : {0.0, 0.5, 1.0}) stage.progress(share);
  EXPECT_EQ(shares, (std::vector<double>{0.5, 0.75, 1.0}));
  EXPECT_EQ(stage.seed, 7U);
  EXPECT_FALSE(Execution().stage(0.5, 1.0).progress) << "nobody asked";
}

TEST(Execution, KeepsSeedAndLogWithoutProgress) {
  const Execution silent =
      Execution{.progress = [](double) {}, .seed = 7, .log = [](const Remark&) {}}
          .without_progress();
  EXPECT_FALSE(silent.progress);
  EXPECT_EQ(silent.seed, 7U);
  EXPECT_TRUE(silent.log);
}

}  // namespace
}  // namespace cairn
