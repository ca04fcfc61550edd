// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/core/executor.hpp"

#include <algorithm>
#include <optional>

#include <tbb/info.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include "cairn/core/error.hpp"

namespace cairn {

struct Executor::Arena {
  explicit Arena(unsigned thread_count) : threads(thread_count) {
    if (threads > 1) arena.emplace(static_cast<int>(threads));
  }

  unsigned threads;
  std::optional<tbb::task_arena> arena;
};

Executor::Executor(unsigned threads) {
  // TBB would complain on stderr about more threads than it has workers for.
  const auto cores = static_cast<unsigned>(std::max(1, tbb::info::default_concurrency()));
  arena_ = std::make_shared<Arena>(threads == 0 ? cores : std::min(threads, cores));
}

unsigned Executor::threads() const noexcept {
  return arena_->threads;
}

void Executor::for_blocks(
    std::size_t count, std::size_t block,
    const std::function<void(std::size_t begin, std::size_t end)>& body) const {
  if (block == 0) {
    throw Error(ErrorKind::kMisuse, "Executor::for_blocks", "block is 0", "at least 1");
  }
  const std::size_t blocks = (count + block - 1) / block;
  const auto run = [&](std::size_t i) { body(i * block, std::min(count, (i + 1) * block)); };
  if (!arena_->arena || blocks < 2) {
    for (std::size_t i = 0; i < blocks; ++i) run(i);
    return;
  }
  arena_->arena->execute(
      [&] { tbb::parallel_for(std::size_t{0}, blocks, run, tbb::simple_partitioner{}); });
}

}  // namespace cairn
