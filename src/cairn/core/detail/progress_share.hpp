// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "cairn/core/progress.hpp"

namespace cairn {

/// Progress of a stage of longer work, which is from `begin` to `end` of the whole. Empty if that is.
inline Progress stage_of(const Progress& progress, double begin, double end) {
  if (!progress) return {};
  return [=](double share) { progress(begin + (end - begin) * share); };
}

}  // namespace cairn
