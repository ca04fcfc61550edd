// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/core/detail/hamming.hpp"

#include <bitset>
#include <vector>

#include <gtest/gtest.h>

#include "cairn/core/random.hpp"

namespace cairn::detail {
namespace {

TEST(Hamming, IsTheNumberOfBitsThatDiffer) {
  Random random(1);
  for (std::size_t words = 0; words < 9; ++words) {
    for (int trial = 0; trial < 100; ++trial) {
      std::vector<std::uint64_t> a(words);
      std::vector<std::uint64_t> b(words);
      std::size_t expected = 0;
      for (std::size_t i = 0; i < words; ++i) {
        a[i] = random.index(1ULL << 62) << 2 | random.index(4);
        // Few bits and many.
        b[i] = trial % 2 == 0 ? ~a[i] ^ (1ULL << random.index(64)) : a[i] & (a[i] << 1);
        expected += std::bitset<64>(a[i] ^ b[i]).count();
      }
      EXPECT_EQ(hamming_distance(a, b), expected);
      EXPECT_EQ(hamming_distance(a, a), 0);
    }
  }
}

TEST(Hamming, CountsAllBits) {
  const std::vector<std::uint64_t> none(4, 0);
  const std::vector<std::uint64_t> all(4, ~0ULL);
  EXPECT_EQ(hamming_distance(none, all), 256);
}

}  // namespace
}  // namespace cairn::detail
