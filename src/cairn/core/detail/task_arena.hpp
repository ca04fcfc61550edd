// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <functional>
#include <memory>

namespace cairn::detail {

/// TBB threads for Executor. Only this class's source includes TBB; the thread sanitizer instruments neither
/// that source nor TBB's library.
class TaskArena {
 public:
  explicit TaskArena(unsigned threads);
  ~TaskArena();
  TaskArena(const TaskArena&) = delete;
  TaskArena& operator=(const TaskArena&) = delete;

  /// Number of cores that the process may use.
  static unsigned most_threads();

  /// Calls `body(i)` for i in [0, count), in parallel and in any order.
  void for_each(std::size_t count, const std::function<void(std::size_t)>& body);

  /// Calls `make(i)` for i in [0, count) in parallel, and `use(i)` after it, one at a time and in order.
  /// Calls `make(i)` only after `use(i - ahead)` has returned.
  void in_order(std::size_t count, std::size_t ahead, const std::function<void(std::size_t)>& make,
                const std::function<void(std::size_t)>& use);

 private:
  struct Arena;
  std::unique_ptr<Arena> arena_;
};

}  // namespace cairn::detail
