// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/registration/convergence/pcl_criteria.hpp"

#include <cmath>

namespace cairn {

std::optional<StopReason> PclCriteria::operator()(const IterationState& state) const {
  if (state.iteration >= max_iterations) return StopReason::kIterationLimit;
  const double cosine = 0.5 * (state.step.rotation().trace() - 1.0);
  if (cosine >= 1.0 && state.step.translation().squaredNorm() <= 0.0) return StopReason::kNoMotion;
  const double change = state.mean_squared_distance - state.previous_mean_squared_distance;
  if (std::abs(change) < mse_change_threshold) return StopReason::kMseChange;
  return std::nullopt;
}

}  // namespace cairn
