// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <functional>
#include <memory>

namespace cairn {

/// Threads of TBB, for Executor. All of TBB that we include is in the source of this class, which the
/// thread sanitizer does not watch, as it does not watch TBB's library.
class TaskArena {
 public:
  explicit TaskArena(unsigned threads);
  ~TaskArena();
  TaskArena(const TaskArena&) = delete;
  TaskArena& operator=(const TaskArena&) = delete;

  /// One a core, or fewer where the process may use fewer cores.
  static unsigned most_threads();

  /// Calls `body(i)` for i in [0, count), in any order and side by side.
  void for_each(std::size_t count, const std::function<void(std::size_t)>& body);

  /// Calls `make(i)` for i in [0, count) side by side, and `use(i)` after it, in order and one at a
  /// time; `make(i)` not before `use(i - ahead)` has returned.
  void in_order(std::size_t count, std::size_t ahead, const std::function<void(std::size_t)>& make,
                const std::function<void(std::size_t)>& use);

 private:
  struct Arena;
  std::unique_ptr<Arena> arena_;
};

}  // namespace cairn
