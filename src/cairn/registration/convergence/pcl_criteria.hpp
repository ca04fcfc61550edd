// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>

#include "cairn/registration/concepts.hpp"

namespace cairn {

/// The stopping rules of PCL's IterativeClosestPoint with its default thresholds, in its order: the
/// iteration limit; a step with exactly no motion; a change of the mean squared match distance below a
/// threshold. Omits PCL's relative change, which is off by default. A ConvergenceTest.
struct PclCriteria {
  int max_iterations = 150;
  double mse_change_threshold = 1e-12;  ///< square of the map's unit of length

  std::optional<StopReason> operator()(const IterationState& state) const;
};

static_assert(ConvergenceTest<PclCriteria>);

}  // namespace cairn
