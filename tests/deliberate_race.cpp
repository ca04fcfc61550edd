// SPDX-License-Identifier: BSD-3-Clause
// Blocks of one loop that add to one number without a lock: what the thread sanitizer has to find.
#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdio>
#include <thread>

#include "cairn/core/execution.hpp"

namespace {

// Waits, for a while, until a second thread takes part: on a busy machine one alone is soon done with
// all blocks. Relaxed, so that nothing is ordered by it.
void wait_for_company() {
  static std::atomic<int> threads = 0;
  thread_local const int number = threads.fetch_add(1, std::memory_order_relaxed);
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(20);
  while (number == 0 && threads.load(std::memory_order_relaxed) < 2 &&
         std::chrono::steady_clock::now() < end) {
    std::this_thread::yield();
  }
}

}  // namespace

int main() {
  std::size_t sum = 0;
  cairn::Executor(2).for_blocks(100'000, 10, [&](std::size_t begin, std::size_t end) {
    wait_for_company();
    sum += end - begin;
  });
  std::printf("%zu\n", sum);
}
