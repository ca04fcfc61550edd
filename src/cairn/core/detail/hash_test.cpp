// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/core/detail/hash.hpp"

#include <string>

#include <gtest/gtest.h>

namespace cairn::detail {
namespace {

// The published test vector of the empty input.
TEST(Hasher, IsXxh3) {
  EXPECT_EQ(to_string(Hasher().digest()), "99aa06d3014798d86001c324468d497f");
}

TEST(Hasher, DoesNotDependOnThePieces) {
  std::string bytes;
  for (int i = 0; i < 5000; ++i) bytes += static_cast<char>(i * i % 251);
  Hasher whole;
  whole.update(bytes);
  for (const std::size_t piece : {1, 7, 240, 256, 1024, 4999}) {
    Hasher hasher;
    for (std::size_t begin = 0; begin < bytes.size(); begin += piece) {
      hasher.update(std::string_view(bytes).substr(begin, piece));
    }
    EXPECT_EQ(hasher.digest(), whole.digest()) << piece;
  }
}

}  // namespace
}  // namespace cairn::detail
