// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/core/detail/descriptor_kernel.hpp"

#include <algorithm>
#include <bit>

#include <gtest/gtest.h>
#include <hwy/targets.h>

#include "cairn/core/random.hpp"

namespace cairn::detail::descriptor_kernel {
namespace {

using Rows = std::vector<std::uint8_t>;

// Of few different values, so that differences are often equal.
Rows rows(std::size_t count, std::size_t bytes_each, Random& random, std::size_t values) {
  Rows result(count * bytes_each);
  for (std::uint8_t& byte : result) {
    byte = static_cast<std::uint8_t>(255 * random.index(values) / (values - 1));
  }
  return result;
}

std::uint32_t difference(const Rows& a, std::size_t i, const Rows& b, std::size_t j,
                         std::size_t bytes_each, Norm norm) {
  std::uint32_t sum = 0;
  for (std::size_t k = 0; k < bytes_each; ++k) {
    const std::uint8_t x = a[i * bytes_each + k];
    const std::uint8_t y = b[j * bytes_each + k];
    const int apart = int{x} - int{y};
    sum += norm == Norm::kHamming
               ? static_cast<std::uint32_t>(std::popcount(static_cast<std::uint8_t>(x ^ y)))
               : static_cast<std::uint32_t>(apart * apart);
  }
  return sum;
}

// @param owners of the rows of b; empty: each its own
Nearest nearest_by_looking_at_all(const Rows& a, std::size_t i, const Rows& b,
                                  std::size_t bytes_each, Norm norm,
                                  const std::vector<std::uint32_t>& owners) {
  Nearest nearest;
  if (!owners.empty()) {
    for (std::uint32_t j = 0; j < owners.size(); ++j) {
      const std::uint32_t d = difference(a, i, b, j, bytes_each, norm);
      if (d < nearest.first) nearest = {j, d, Nearest::kNone};
    }
    for (std::uint32_t j = 0; j < owners.size(); ++j) {
      if (owners[j] == owners[nearest.index]) continue;
      nearest.second = std::min(nearest.second, difference(a, i, b, j, bytes_each, norm));
    }
    return nearest;
  }
  for (std::uint32_t j = 0; j < b.size() / bytes_each; ++j) {
    const std::uint32_t d = difference(a, i, b, j, bytes_each, norm);
    if (d < nearest.first) {
      nearest.second = nearest.first;
      nearest.first = d;
      nearest.index = j;
    } else if (d < nearest.second) {
      nearest.second = d;
    }
  }
  return nearest;
}

void expect_those_of_looking_at_all(bool owned) {
  Random random(5);
  std::vector<std::uint32_t> owners;
  for (std::uint32_t j = 0; owned && j < 40; ++j) owners.push_back(j * j % 13);
  for (const Norm norm : {Norm::kHamming, Norm::kSquaredBytes}) {
    for (const std::size_t bytes_each : {1U, 3U, 32U, 61U, 128U, 300U}) {
      for (const std::size_t count : {1U, 15U, 33U, 70U}) {
        const Rows a = rows(count, bytes_each, random, count == 33 ? 2 : 200);
        const Rows b = rows(40, bytes_each, random, count == 33 ? 2 : 200);
        const NearestBothWays found = nearest_both_ways(a, b, bytes_each, norm, owners);
        ASSERT_EQ(found.of_a.size(), count);
        ASSERT_EQ(found.of_b.size(), 40U);
        for (std::size_t i = 0; i < count; ++i) {
          const Nearest expected = nearest_by_looking_at_all(a, i, b, bytes_each, norm, owners);
          EXPECT_EQ(found.of_a[i].index, expected.index);
          EXPECT_EQ(found.of_a[i].first, expected.first);
          EXPECT_EQ(found.of_a[i].second, expected.second);
        }
        for (std::size_t j = 0; j < 40; ++j) {
          const Nearest expected = nearest_by_looking_at_all(b, j, a, bytes_each, norm, {});
          EXPECT_EQ(found.of_b[j].index, expected.index);
          EXPECT_EQ(found.of_b[j].first, expected.first);
        }
      }
    }
  }
}

TEST(DescriptorKernel, FindsThoseOfLookingAtAllOnEveryInstructionSet) {
  for (const std::int64_t target : hwy::SupportedAndGeneratedTargets()) {
    SCOPED_TRACE(hwy::TargetName(target));
    hwy::SetSupportedTargetsForTest(target);
    for (const bool owned : {false, true}) expect_those_of_looking_at_all(owned);
  }
  hwy::SetSupportedTargetsForTest(0);
}

TEST(DescriptorKernel, FindsTheNearestPairOnEveryInstructionSet) {
  Random random(7);
  for (const std::int64_t target : hwy::SupportedAndGeneratedTargets()) {
    SCOPED_TRACE(hwy::TargetName(target));
    hwy::SetSupportedTargetsForTest(target);
    for (const Norm norm : {Norm::kHamming, Norm::kSquaredBytes}) {
      for (const std::size_t bytes_each : {1U, 8U, 32U, 61U, 128U, 300U}) {
        // Two different values often give equal distances.
        for (const std::size_t values : {2U, 200U}) {
          const Rows a = rows(3, bytes_each, random, values);
          const Rows b = rows(5, bytes_each, random, values);
          NearestPair least;
          for (std::size_t i = 0; i < 3; ++i) {
            for (std::size_t j = 0; j < 5; ++j) {
              const std::uint32_t d = difference(a, i, b, j, bytes_each, norm);
              if (d < least.distance) least = {i, j, d};
            }
          }
          const NearestPair found = nearest_pair(a, b, bytes_each, norm);
          EXPECT_EQ(found.a, least.a);
          EXPECT_EQ(found.b, least.b);
          EXPECT_EQ(found.distance, least.distance);
        }
      }
    }
  }
  hwy::SetSupportedTargetsForTest(0);
  EXPECT_EQ(nearest_pair(Rows(32, 1), {}, 32, Norm::kHamming).distance, Nearest::kNone);
}

// The rows of b are compared in blocks.
TEST(DescriptorKernel, ComparesManyRowsAsItDoesFew) {
  Random random(9);
  for (const Norm norm : {Norm::kHamming, Norm::kSquaredBytes}) {
    const Rows a = rows(7, 32, random, norm == Norm::kHamming ? 2 : 9);
    const Rows b = rows(2500, 32, random, norm == Norm::kHamming ? 2 : 9);
    for (const std::uint32_t owners : {0U, 3U, 900U}) {
      std::vector<std::uint32_t> owner_of(owners == 0 ? 0 : 2500);
      for (std::uint32_t& owner : owner_of) {
        owner = static_cast<std::uint32_t>(random.index(owners));
      }
      const NearestBothWays found = nearest_both_ways(a, b, 32, norm, owner_of);
      for (std::size_t i = 0; i < 7; ++i) {
        const Nearest expected = nearest_by_looking_at_all(a, i, b, 32, norm, owner_of);
        EXPECT_EQ(found.of_a[i].index, expected.index);
        EXPECT_EQ(found.of_a[i].first, expected.first);
        EXPECT_EQ(found.of_a[i].second, expected.second);
      }
      for (std::size_t j = 0; j < 2500; ++j) {
        const Nearest expected = nearest_by_looking_at_all(b, j, a, 32, norm, {});
        EXPECT_EQ(found.of_b[j].index, expected.index);
        EXPECT_EQ(found.of_b[j].first, expected.first);
      }
    }
  }
}

TEST(DescriptorKernel, FindsNothingAmongNone) {
  const Rows some(64, 7);
  const NearestBothWays found = nearest_both_ways(some, {}, 32, Norm::kHamming);
  ASSERT_EQ(found.of_a.size(), 2U);
  EXPECT_TRUE(found.of_b.empty());
  EXPECT_EQ(found.of_a[0].index, Nearest::kNone);
  EXPECT_EQ(found.of_a[0].first, Nearest::kNone);
}

TEST(DescriptorKernel, HasNoSecondAmongOne) {
  const Rows one(32, 7);
  EXPECT_EQ(nearest_both_ways(one, one, 32, Norm::kHamming).of_a[0].second, Nearest::kNone);
}

}  // namespace
}  // namespace cairn::detail::descriptor_kernel
