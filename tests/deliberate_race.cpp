// SPDX-License-Identifier: BSD-3-Clause
// Blocks of one loop that add to one number without a lock: what the thread sanitizer has to find.
#include <cstddef>
#include <cstdio>

#include "cairn/core/executor.hpp"

int main() {
  std::size_t sum = 0;
  for (int i = 0; i < 100; ++i) {
    cairn::Executor(4).for_blocks(10'000, 10,
                                  [&](std::size_t begin, std::size_t end) { sum += end - begin; });
  }
  std::printf("%zu\n", sum);
}
