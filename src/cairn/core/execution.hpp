// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <stop_token>

#include "cairn/core/executor.hpp"
#include "cairn/core/progress.hpp"

namespace cairn {

/// Where work runs, its cancellation and its progress.
struct Execution {
  Executor executor = Executor();  ///< one thread by default; results do not depend on the number
  std::stop_token stop = {};
  Progress progress = {};

  /// For work within other work that reports its own progress.
  Execution without_progress() const { return {executor, stop, {}}; }
};

}  // namespace cairn
