// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <stop_token>
#include <utility>

#include "cairn/core/log.hpp"

namespace cairn {

/// Runs work on a bounded number of threads. Copies share the threads.
///
/// Block bounds depend only on the amount of work, so block-wise results are identical for any
/// number of threads.
class Executor {
 public:
  /// @param threads at most this many, and at most one per core; 0 means one per core
  explicit Executor(unsigned threads = 1);

  /// The actual number of threads.
  unsigned threads() const noexcept;

  /// Calls `body(begin, end)` for consecutive ranges that cover [0, count), each of `block` items
  /// except the last. Returns after the last block; rethrows an exception from `body`.
  void for_blocks(std::size_t count, std::size_t block,
                  const std::function<void(std::size_t begin, std::size_t end)>& body) const;

  /// Calls `use(i, make(i))` sequentially for i = 0, ..., count - 1, while other threads run `make`
  /// up to `ahead` items ahead. Rethrows an exception from either function.
  template <class Make, class Use>
  void in_order(std::size_t count, std::size_t ahead, const Make& make, const Use& use) const {
    using Item = decltype(make(std::size_t{}));
    run_in_order(
        count, ahead,
        [&](std::size_t i) -> std::shared_ptr<void> { return std::make_shared<Item>(make(i)); },
        [&](std::size_t i, void* item) { use(i, std::move(*static_cast<Item*>(item))); });
  }

 private:
  void run_in_order(std::size_t count, std::size_t ahead,
                    const std::function<std::shared_ptr<void>(std::size_t)>& make,
                    const std::function<void(std::size_t, void*)>& use) const;

  struct Threads;
  std::shared_ptr<Threads> threads_;
};

/// Called occasionally with the completed share of the work, in [0, 1], from one thread at a time;
/// may be empty. The std::stop_token passed with it cancels the work.
using Progress = std::function<void(double share)>;

/// Execution settings of a call: threads, cancellation, progress, seed and log. The same input,
/// options and seed give the same bytes for any number of threads.
struct Execution {
  Executor executor = Executor();  ///< one thread by default
  std::stop_token stop = {};
  Progress progress = {};
  std::uint64_t seed = 0;  ///< random number seed
  LogSink log = {};        ///< receives remarks, e.g. on omitted data

  /// Copy for a nested call whose caller reports the progress.
  Execution without_progress() const { return {executor, stop, {}, seed, log}; }
  /// Copy for a stage whose progress spans [begin, end] of the whole.
  Execution stage(double begin, double end) const {
    Execution part = *this;
    if (progress) {
      part.progress = [begin, end, whole = progress](double share) {
        whole(begin + (end - begin) * share);
      };
    }
    return part;
  }
};

}  // namespace cairn
