// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/map/distinct_descriptors.hpp"

#include <algorithm>
#include <limits>
#include <numeric>
#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/core/random.hpp"

namespace cairn {
namespace {

using ::testing::ElementsAre;
using Bytes = std::vector<std::uint8_t>;

std::vector<std::span<const std::uint8_t>> spans(const std::vector<Bytes>& rows) {
  return {rows.begin(), rows.end()};
}

TEST(DistinctDescriptors, ChooseTheFarthestFromThoseChosen) {
  const std::vector<Bytes> rows = {{0x00}, {0x01}, {0xff}, {0x0f}, {0x00}};
  EXPECT_THAT(distinct_descriptors(spans(rows), 0, 3, DescriptorNorm::kHamming),
              ElementsAre(0, 2, 3));
  EXPECT_THAT(distinct_descriptors(spans(rows), 3, 1, DescriptorNorm::kHamming), ElementsAre(3));
  // By bytes, 0x0f is nearer to 0 than 0xff is to it.
  EXPECT_THAT(distinct_descriptors(spans(rows), 2, 2, DescriptorNorm::kSquared), ElementsAre(2, 0));
}

TEST(DistinctDescriptors, StopWhereAllOthersAreEqualToAChosenOne) {
  const std::vector<Bytes> rows = {{7, 7}, {7, 7}, {8, 7}, {7, 7}};
  EXPECT_THAT(distinct_descriptors(spans(rows), 1, 4, DescriptorNorm::kHamming), ElementsAre(1, 2));
}

TEST(DistinctDescriptors, AreThreeOrMoreWhereThereAreSoManyDifferentOnes) {
  Random random(3);
  for (int trial = 0; trial < 50; ++trial) {
    std::vector<Bytes> rows(2 + random.index(9));
    for (Bytes& row : rows) {
      for (int i = 0; i < 4; ++i) row.push_back(static_cast<std::uint8_t>(random.index(256)));
    }
    const std::size_t first = random.index(rows.size());
    const auto chosen =
        distinct_descriptors(spans(rows), first, kDistinctViews, DescriptorNorm::kHamming);
    EXPECT_EQ(chosen.size(), std::min(rows.size(), kDistinctViews));
    EXPECT_EQ(std::set<std::size_t>(chosen.begin(), chosen.end()).size(), chosen.size());
    EXPECT_EQ(chosen.front(), first);
    // Each is as far from those before as any.
    for (std::size_t k = 1; k < chosen.size(); ++k) {
      const auto away = [&](std::size_t i) {
        auto least = std::numeric_limits<std::uint64_t>::max();
        for (std::size_t j = 0; j < k; ++j) {
          least = std::min(
              least, descriptor_difference(rows[i], rows[chosen[j]], DescriptorNorm::kHamming));
        }
        return least;
      };
      for (std::size_t i = 0; i < rows.size(); ++i) EXPECT_LE(away(i), away(chosen[k]));
    }
  }
}

TEST(AppendDescriptors, AddsRowsWithAndWithoutFurtherOnes) {
  DescriptorColumn column{"ORB", 1, {}, {}};
  append_descriptors(column, spans({{1}}));
  EXPECT_FALSE(column.has_further());
  append_descriptors(column, {});
  append_descriptors(column, spans({{2}, {3}, {4}}));
  append_descriptors(column, spans({{5}}));
  EXPECT_THAT(column.known, ElementsAre(1, 0, 1, 1));
  EXPECT_THAT(column.bytes, ElementsAre(1, 0, 2, 5));
  EXPECT_THAT(column.further_offsets, ElementsAre(0, 0, 0, 2, 2));
  EXPECT_THAT(column.further, ElementsAre(3, 4));
}

}  // namespace
}  // namespace cairn
