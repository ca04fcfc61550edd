// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/core/detail/sampling.hpp"

#include <set>

#include <gtest/gtest.h>

namespace cairn::detail {
namespace {

TEST(OneOfEach, TakesOneOfEachRowAndOfTheRest) {
  const auto sample = one_of_each(4, 10, Random(1));
  ASSERT_EQ(sample.size(), 3U);
  for (std::size_t i = 0; i < sample.size(); ++i) EXPECT_EQ(sample[i] / 4, i);
  EXPECT_LT(sample[2], 10U);
  EXPECT_TRUE(one_of_each(4, 0, Random(1)).empty());
  EXPECT_EQ(one_of_each(1, 3, Random(1)), (std::vector<std::size_t>{0, 1, 2}));
}

TEST(OneOfEach, HasNoPeriod) {
  std::set<std::size_t> places;
  for (const std::size_t i : one_of_each(8, 800, Random(2))) places.insert(i % 8);
  EXPECT_EQ(places.size(), 8U);
  EXPECT_EQ(one_of_each(8, 800, Random(2)), one_of_each(8, 800, Random(2)));
}

}  // namespace
}  // namespace cairn::detail
