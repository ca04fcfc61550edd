// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <functional>
#include <memory>

namespace cairn {

/// Where work runs: a bounded number of threads. Copies share the same threads.
///
/// Work is cut into blocks whose bounds depend on the amount of work only, never on the number of
/// threads, so what is computed block by block is the same with any number of them.
class Executor {
 public:
  /// @param threads at most this many, and at most one per core; 0 means one per core
  explicit Executor(unsigned threads = 1);

  /// How many there really are.
  unsigned threads() const noexcept;

  /// Calls `body(begin, end)` for consecutive ranges that cover [0, count), each of `block` items
  /// but the last. Returns when all are done; rethrows an exception of `body`.
  void for_blocks(std::size_t count, std::size_t block,
                  const std::function<void(std::size_t begin, std::size_t end)>& body) const;

 private:
  struct Arena;
  std::shared_ptr<Arena> arena_;
};

}  // namespace cairn
