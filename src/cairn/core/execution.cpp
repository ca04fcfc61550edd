// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/core/execution.hpp"

#include <algorithm>
#include <optional>
#include <vector>

#include "cairn/core/detail/task_arena.hpp"
#include "cairn/core/error.hpp"

namespace cairn {

struct Executor::Threads {
  explicit Threads(unsigned thread_count) : count(thread_count) {
    if (count > 1) arena.emplace(count);
  }

  unsigned count;
  std::optional<detail::TaskArena> arena;
};

Executor::Executor(unsigned threads) {
  // With more threads than workers, TBB prints a warning to stderr.
  const unsigned most = detail::TaskArena::most_threads();
  threads_ = std::make_shared<Threads>(threads == 0 ? most : std::min(threads, most));
}

unsigned Executor::threads() const noexcept {
  return threads_->count;
}

void Executor::for_blocks(
    std::size_t count, std::size_t block,
    const std::function<void(std::size_t begin, std::size_t end)>& body) const {
  refuse_if(block == 0, "Executor::for_blocks", "block is 0", "at least 1");
  const std::size_t blocks = (count + block - 1) / block;
  const auto run = [&](std::size_t i) { body(i * block, std::min(count, (i + 1) * block)); };
  if (!threads_->arena || blocks < 2) {
    for (std::size_t i = 0; i < blocks; ++i) run(i);
    return;
  }
  threads_->arena->for_each(blocks, run);
}

void Executor::run_in_order(std::size_t count, std::size_t ahead,
                            const std::function<std::shared_ptr<void>(std::size_t)>& make,
                            const std::function<void(std::size_t, void*)>& use) const {
  if (!threads_->arena || count < 2) {
    for (std::size_t i = 0; i < count; ++i) use(i, make(i).get());
    return;
  }
  // One slot per item that can be in the pipeline. Items leave in order, so the slot of item i is free when
  // it enters.
  std::vector<std::shared_ptr<void>> items(ahead + 1);
  threads_->arena->in_order(
      count, items.size(), [&](std::size_t i) { items[i % items.size()] = make(i); },
      [&](std::size_t i) {
        std::shared_ptr<void>& item = items[i % items.size()];
        use(i, item.get());
        item.reset();
      });
}

}  // namespace cairn
