// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <stop_token>

#include "cairn/core/executor.hpp"

namespace cairn {

/// Called occasionally with the share of the work that is done, in [0, 1]. From one thread at a time; may
/// be empty. To cancel the work, use the std::stop_token passed with it.
using Progress = std::function<void(double share)>;

/// Where work runs, its cancellation and its progress.
struct Execution {
  Executor executor = Executor();  ///< one thread by default; results do not depend on the number
  std::stop_token stop = {};
  Progress progress = {};

  /// For work within other work that reports its own progress.
  Execution without_progress() const { return {executor, stop, {}}; }
};

}  // namespace cairn
