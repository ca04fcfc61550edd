// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>
#include <optional>

#include "cairn/registration/stages.hpp"

namespace cairn {

/// A ConvergenceTest with the criteria of PCL's IterativeClosestPoint, in PCL's order and with
/// PCL's default thresholds: the iteration limit; a step without any motion; a change of the mean
/// squared match distance below a threshold. Omits PCL's relative change, which is off by default.
struct PclCriteria {
  int max_iterations = 150;
  double mse_change_threshold = 1e-12;  ///< square of the map's unit of length

  std::optional<StopReason> operator()(const IterationState& state) const;
};

inline std::optional<StopReason> PclCriteria::operator()(const IterationState& state) const {
  if (state.iteration >= max_iterations) return StopReason::kIterationLimit;
  const double cosine = 0.5 * (state.step.rotation().trace() - 1.0);
  if (cosine >= 1.0 && state.step.translation().squaredNorm() <= 0.0) return StopReason::kNoMotion;
  const double change = state.mean_squared_distance - state.previous_mean_squared_distance;
  if (std::abs(change) < mse_change_threshold) return StopReason::kMseChange;
  return std::nullopt;
}

static_assert(ConvergenceTest<PclCriteria>);

}  // namespace cairn
