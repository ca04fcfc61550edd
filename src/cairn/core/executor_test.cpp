// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/core/executor.hpp"

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

}  // namespace
}  // namespace cairn
