// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "cairn/trajectory/trajectory.hpp"
#include "cairn/trajectory/trajectory_error.hpp"

namespace cairn {

struct TrajectoryEvaluationOptions {
  TrajectoryAlignment alignment = TrajectoryAlignment::kSe3;
  double max_time_difference_s = 0.02;  ///< between poses that are paired; positive
  /// Over which relative errors are taken.
  std::vector<RelativeInterval> intervals = {{RelativeInterval::Unit::kMetres, 1.0},
                                             {RelativeInterval::Unit::kSeconds, 1.0},
                                             {RelativeInterval::Unit::kFrames, 1.0}};

  /// @throws Error (misuse) naming the field
  void validate() const;
};

/// An estimated trajectory against the true one.
struct TrajectoryEvaluation {
  PosePairs pairs;                        ///< (estimate, truth)
  std::optional<AbsoluteError> absolute;  ///< nothing if the trajectories cannot be aligned
  std::string reason;                     ///< why they cannot; empty if they can
  /// One an interval of the options; nothing where the trajectory is shorter than it, or could not
  /// be aligned.
  std::vector<std::optional<RelativeError>> relative;
};

/// Pairs the poses by time, aligns and takes all errors. Relative errors do not depend on the
/// alignment but for its scale: with kSim3 they are those of the estimate in the truth's scale.
TrajectoryEvaluation evaluate_trajectory(const Trajectory& estimate, const Trajectory& truth,
                                         const TrajectoryEvaluationOptions& options = {});

}  // namespace cairn
