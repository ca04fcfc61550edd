// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "cairn/core/execution.hpp"

namespace cairn::detail {

/// Progress of a stage that extends from `begin` to `end` of the whole work. Empty if `progress` is.
inline Progress stage_of(const Progress& progress, double begin, double end) {
  if (!progress) return {};
  return [=](double share) { progress(begin + (end - begin) * share); };
}

}  // namespace cairn::detail
