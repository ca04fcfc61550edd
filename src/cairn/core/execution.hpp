// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <stop_token>

#include "cairn/core/executor.hpp"
#include "cairn/core/progress.hpp"

namespace cairn {

/// Where work runs, whether it is still wanted, and who is told how far it is.
struct Execution {
  Executor executor = Executor();  ///< one thread by default; results do not depend on how many
  std::stop_token stop = {};
  Progress progress = {};

  /// For work that is part of another, which tells of its own progress.
  Execution without_progress() const { return {executor, stop, {}}; }
};

}  // namespace cairn
