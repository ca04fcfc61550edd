// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/core/detail/task_arena.hpp"

#include <algorithm>
#include <stdexcept>
#include <string_view>
#include <vector>

#include <fmt/format.h>
#include <tbb/info.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_pipeline.h>
#include <tbb/task_arena.h>

#include "cairn/core/error.hpp"

#ifdef CAIRN_THREAD_SANITIZER
#include <sanitizer/tsan_interface.h>
#endif

namespace cairn::detail {
namespace {

// The thread sanitizer does not instrument TBB or this file, so it does not know TBB's guarantee that code
// before a loop happens before its blocks, and these before code after it. These annotations declare it: code
// before release(x) happens before code after a later acquire(x). Blocks remain unordered, so that races
// between them are still found.
#ifdef CAIRN_THREAD_SANITIZER
void release(char& what) {
  __tsan_release(&what);
}
void acquire(char& what) {
  __tsan_acquire(&what);
}
#else
void release(char& /*what*/) {}
void acquire(char& /*what*/) {}
#endif

// Global, because the variables that a block captures are also written before it.
char loop_began = 0;
char block_ended = 0;

struct LoopOrder {
  LoopOrder() { release(loop_began); }
  LoopOrder(const LoopOrder&) = delete;
  LoopOrder& operator=(const LoopOrder&) = delete;
  ~LoopOrder() { acquire(block_ended); }
};

struct BlockOrder {
  BlockOrder() { acquire(loop_began); }
  BlockOrder(const BlockOrder&) = delete;
  BlockOrder& operator=(const BlockOrder&) = delete;
  ~BlockOrder() { release(block_ended); }
};

// Orders code that runs one after another.
class Turn {
 public:
  explicit Turn(char& order) : order_(&order) { acquire(*order_); }
  Turn(const Turn&) = delete;
  Turn& operator=(const Turn&) = delete;
  ~Turn() { release(*order_); }

 private:
  char* order_;
};

// TBB starts its threads when it first has work for them. If the system refuses one, TBB throws std::runtime_error.
template <class Work>
void execute(tbb::task_arena& arena, const Work& work) {
  try {
    arena.execute(work);
  } catch (const std::runtime_error& error) {
    acquire(block_ended);  // It may be what a block threw.
    if (!std::string_view(error.what()).starts_with("pthread_create")) throw;
    throw Error(ErrorKind::kStorage, "threads",
                fmt::format("the operating system cannot start another ({})", error.what()),
                "fewer threads");
  }
}

}  // namespace

struct TaskArena::Arena {
  explicit Arena(unsigned threads) : arena(static_cast<int>(threads)) {}
  tbb::task_arena arena;
};

TaskArena::TaskArena(unsigned threads) : arena_(std::make_unique<Arena>(threads)) {}

TaskArena::~TaskArena() = default;

unsigned TaskArena::most_threads() {
  return static_cast<unsigned>(std::max(1, tbb::info::default_concurrency()));
}

void TaskArena::for_each(std::size_t count, const std::function<void(std::size_t)>& body) {
  const auto ordered = [&](std::size_t i) {
    const BlockOrder block_order;
    body(i);
  };
  const LoopOrder loop_order;
  execute(arena_->arena,
          [&] { tbb::parallel_for(std::size_t{0}, count, ordered, tbb::simple_partitioner{}); });
}

void TaskArena::in_order(std::size_t count, std::size_t ahead,
                         const std::function<void(std::size_t)>& make,
                         const std::function<void(std::size_t)>& use) {
  std::size_t next = 0;
  const auto number = tbb::make_filter<void, std::size_t>(tbb::filter_mode::serial_in_order,
                                                          [&](tbb::flow_control& control) {
                                                            if (next < count) return next++;
                                                            control.stop();
                                                            return next;
                                                          });
  char order_of_use = 0;
  std::vector<char> items(ahead);  // in the pipeline
  const auto making =
      tbb::make_filter<std::size_t, std::size_t>(tbb::filter_mode::parallel, [&](std::size_t i) {
        const BlockOrder block_order;
        const Turn turn(items[i % ahead]);
        make(i);
        return i;
      });
  const auto using_up =
      tbb::make_filter<std::size_t, void>(tbb::filter_mode::serial_in_order, [&](std::size_t i) {
        const BlockOrder block_order;
        const Turn turn(items[i % ahead]);
        const Turn turn_of_use(order_of_use);
        use(i);
      });
  const LoopOrder loop_order;
  execute(arena_->arena, [&] { tbb::parallel_pipeline(ahead, number & making & using_up); });
}

}  // namespace cairn::detail
