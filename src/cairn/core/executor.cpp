// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/core/executor.hpp"

#include <algorithm>
#include <atomic>
#include <optional>
#include <vector>

#include <tbb/info.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_pipeline.h>
#include <tbb/task_arena.h>

#include "cairn/core/error.hpp"

#if defined(__SANITIZE_THREAD__)
#define CAIRN_THREAD_SANITIZER 1
#elif defined(__has_feature)
#if __has_feature(thread_sanitizer)
#define CAIRN_THREAD_SANITIZER 1
#endif
#endif

namespace cairn {
namespace {

#ifdef CAIRN_THREAD_SANITIZER
// TBB's library is not built with the thread sanitizer, which therefore misses what TBB guarantees:
// what comes before a loop happens before its blocks, and these before what comes after. Here it is
// told so. Blocks stay unordered among each other, so that races between them still show.
std::atomic<unsigned> loop_began;  // global, for even what a block captured was written before it
std::atomic<unsigned> block_ended;

struct LoopOrder {
  LoopOrder() { loop_began.fetch_add(1, std::memory_order_release); }
  LoopOrder(const LoopOrder&) = delete;
  LoopOrder& operator=(const LoopOrder&) = delete;
  ~LoopOrder() { (void)block_ended.load(std::memory_order_acquire); }
};

struct BlockOrder {
  BlockOrder() { (void)loop_began.load(std::memory_order_acquire); }
  BlockOrder(const BlockOrder&) = delete;
  BlockOrder& operator=(const BlockOrder&) = delete;
  ~BlockOrder() { block_ended.fetch_add(1, std::memory_order_release); }
};

// One stage of a pipeline that runs its items one after the other.
class SerialOrder {
 public:
  class Turn {
   public:
    explicit Turn(SerialOrder& order) : order_(&order) {
      (void)order_->ended_.load(std::memory_order_acquire);
    }
    Turn(const Turn&) = delete;
    Turn& operator=(const Turn&) = delete;
    ~Turn() { order_->ended_.fetch_add(1, std::memory_order_release); }

   private:
    SerialOrder* order_;
  };

 private:
  std::atomic<unsigned> ended_ = 0;
};
#else
struct LoopOrder {};
struct BlockOrder {};
struct SerialOrder {
  struct Turn {
    explicit Turn(SerialOrder& /*order*/) {}
  };
};
#endif

// An item on its way through run_in_order.
struct Numbered {
  std::size_t number = 0;
  std::shared_ptr<void> item;
#ifdef CAIRN_THREAD_SANITIZER
  // TBB hands it on; see above.
  std::atomic<unsigned> handed_on = 0;
  void hand_on() { handed_on.fetch_add(1, std::memory_order_release); }
  void take() { (void)handed_on.load(std::memory_order_acquire); }
#else
  void hand_on() {}
  void take() {}
#endif
};

}  // namespace

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
  const auto run_ordered = [&](std::size_t i) {
    [[maybe_unused]] const BlockOrder block_order;
    run(i);
  };
  [[maybe_unused]] const LoopOrder loop_order;
  arena_->arena->execute(
      [&] { tbb::parallel_for(std::size_t{0}, blocks, run_ordered, tbb::simple_partitioner{}); });
}

void Executor::run_in_order(std::size_t count, std::size_t ahead,
                            const std::function<std::shared_ptr<void>(std::size_t)>& make,
                            const std::function<void(std::size_t, void*)>& use) const {
  if (!arena_->arena || count < 2) {
    for (std::size_t i = 0; i < count; ++i) use(i, make(i).get());
    return;
  }
  std::size_t next = 0;
  SerialOrder numbering;
  SerialOrder order_of_use;
  const auto number = tbb::make_filter<void, std::size_t>(
      tbb::filter_mode::serial_in_order, [&](tbb::flow_control& control) {
        [[maybe_unused]] const BlockOrder block_order;
        [[maybe_unused]] const SerialOrder::Turn turn(numbering);
        if (next == count) {
          control.stop();
          return next;
        }
        return next++;
      });
  // Items stay here, for TBB forgets what is on its way when an exception ends the pipeline. As many
  // as can be on their way, which leave in order: the place of item i is free when i begins.
  std::vector<Numbered> places(ahead + 1);
  const auto making =
      tbb::make_filter<std::size_t, Numbered*>(tbb::filter_mode::parallel, [&](std::size_t i) {
        [[maybe_unused]] const BlockOrder block_order;
        Numbered& made = places[i % places.size()];
        made.take();
        made.number = i;
        made.item = make(i);
        made.hand_on();
        return &made;
      });
  const auto using_up =
      tbb::make_filter<Numbered*, void>(tbb::filter_mode::serial_in_order, [&](Numbered* made) {
        [[maybe_unused]] const BlockOrder block_order;
        [[maybe_unused]] const SerialOrder::Turn turn(order_of_use);
        made->take();
        use(made->number, made->item.get());
        made->item.reset();
        made->hand_on();
      });
  [[maybe_unused]] const LoopOrder loop_order;
  arena_->arena->execute(
      [&] { tbb::parallel_pipeline(places.size(), number & making & using_up); });
}

}  // namespace cairn
