// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <stop_token>

#include "cairn/core/log.hpp"
#include "cairn/core/progress.hpp"

namespace cairn {

/// What every reader of a map format takes.
struct MapReadOptions {
  Progress progress = {};
  std::stop_token stop = {};  ///< asked for: reading throws Error (cancelled)
  LogSink log = {};           ///< told what was left out and why
};

}  // namespace cairn
