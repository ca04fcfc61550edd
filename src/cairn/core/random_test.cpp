// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/core/random.hpp"

#include <array>

#include <gtest/gtest.h>

#include "cairn/core/error.hpp"

namespace cairn {
namespace {

TEST(Random, IsTheSameEverywhereForOneSeed) {
  Random random(42);
  EXPECT_EQ(random.uniform(), 0x1.1e0c5b02ab5dp-3);
  EXPECT_EQ(Random(42).fork(3).index(1000000), Random(42).fork(3).index(1000000));
}

TEST(Random, ForksAreIndependentOfDrawsAndOfEachOther) {
  Random parent(7);
  const double before = parent.fork(1).uniform();
  parent.uniform();
  EXPECT_EQ(parent.fork(1).uniform(), before);
  EXPECT_NE(parent.fork(2).uniform(), before);
}

TEST(Random, UniformAndNormalHaveTheirMoments) {
  Random random(1);
  constexpr int kDraws = 200000;
  double sum = 0.0;
  double normal_sum = 0.0;
  double normal_squares = 0.0;
  for (int i = 0; i < kDraws; ++i) {
    const double u = random.uniform();
    ASSERT_GE(u, 0.0);
    ASSERT_LT(u, 1.0);
    sum += u;
    const double z = random.normal();
    normal_sum += z;
    normal_squares += z * z;
  }
  EXPECT_NEAR(sum / kDraws, 0.5, 0.005);
  EXPECT_NEAR(normal_sum / kDraws, 0.0, 0.01);
  EXPECT_NEAR(normal_squares / kDraws, 1.0, 0.02);
}

TEST(Random, IndexCoversItsRangeEvenly) {
  Random random(3);
  std::array<int, 7> counts{};
  for (int i = 0; i < 70000; ++i) ++counts.at(random.index(counts.size()));
  for (const int count : counts) EXPECT_NEAR(count, 10000, 500);
  EXPECT_THROW(random.index(0), Error);
}

}  // namespace
}  // namespace cairn
