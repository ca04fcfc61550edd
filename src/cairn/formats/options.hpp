// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <stop_token>

#include "cairn/core/execution.hpp"
#include "cairn/core/log.hpp"

namespace cairn {

/// Options of every map reader.
struct MapReadOptions {
  Progress progress = {};
  std::stop_token stop = {};  ///< if requested, reading throws Error (cancelled)
  LogSink log = {};           ///< reports what was left out and why
};

}  // namespace cairn
