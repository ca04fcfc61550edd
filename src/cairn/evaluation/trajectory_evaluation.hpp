// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "cairn/evaluation/trajectory_error.hpp"
#include "cairn/geometry/trajectory.hpp"

namespace cairn {

struct TrajectoryEvaluationOptions {
  TrajectoryAlignment alignment = TrajectoryAlignment::kSe3;
  double max_time_difference_s = 0.02;  ///< largest difference of paired poses; positive
  /// Intervals of the relative errors.
  std::vector<RelativeInterval> intervals = {{RelativeInterval::Unit::kMetres, 1.0},
                                             {RelativeInterval::Unit::kSeconds, 1.0},
                                             {RelativeInterval::Unit::kFrames, 1.0}};

  /// @throws Error (misuse) naming the field
  void validate() const;
};

/// Comparison of an estimated trajectory with the truth.
struct TrajectoryEvaluation {
  PosePairs pairs;                        ///< (estimate, truth)
  std::optional<AbsoluteError> absolute;  ///< std::nullopt if the trajectories cannot be aligned
  std::string reason;                     ///< why they cannot be aligned; empty if they can
  /// One per interval of the options; std::nullopt if the trajectory is shorter, or could not be aligned.
  std::vector<std::optional<RelativeError>> relative;
};

/// Pairs the poses by time, aligns and computes all errors. Relative errors depend on the alignment only
/// through its scale: with kSim3 they are in the truth's scale.
TrajectoryEvaluation evaluate_trajectory(const Trajectory& estimate, const Trajectory& truth,
                                         const TrajectoryEvaluationOptions& options = {});

}  // namespace cairn
