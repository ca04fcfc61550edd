// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "cairn/core/error_statistics.hpp"
#include "cairn/geometry/similarity3.hpp"
#include "cairn/trajectory/trajectory.hpp"

/// Errors of an estimated trajectory against the true one, as the TUM RGB-D benchmark (Sturm et
/// al., IROS 2012) and evo define them.
namespace cairn {

/// How to bring the estimate into the frame of the truth before comparing.
enum class TrajectoryAlignment {
  kNone,    ///< both are in one frame already
  kOrigin,  ///< the first pair of poses coincides
  kSe3,     ///< least squares over all positions, rotation and translation
  kSim3,    ///< and scale
  /// Mean rotation by the orientations (chordal), then mean translation: determined for any path, as
  /// long as both trajectories are of one camera body.
  kPoses,
};

struct AbsoluteError {
  Similarity3 truth_from_estimate;    ///< the alignment
  ErrorStatistics translation;        ///< distances between positions, in the truth's unit
  ErrorStatistics rotation_rad;       ///< angles between orientations
  std::vector<double> translations;   ///< one a pair
  std::vector<double> rotations_rad;  ///< one a pair
};

/// Absolute trajectory error (ATE) over the pairs of poses.
/// @param pairs (estimate, truth); see associate()
/// @return nothing if there are too few pairs for the alignment: 1, or 3 for kSe3 and kSim3
std::optional<AbsoluteError> absolute_error(const Trajectory& estimate, const Trajectory& truth,
                                            const PosePairs& pairs, TrajectoryAlignment alignment);

/// Over which stretch a relative error is taken.
struct RelativeInterval {
  enum class Unit {
    kSeconds,
    kMetres,  ///< along the true path
    kFrames,  ///< associated poses
  };
  Unit unit = Unit::kSeconds;
  double length = 1.0;  ///< positive; whole for frames

  /// @throws Error (misuse) naming the field
  void validate() const;
};

struct RelativeError {
  ErrorStatistics translation;   ///< drift over the interval, in the truth's unit
  ErrorStatistics rotation_rad;  ///< angle of the drift
};

/// Relative pose error (RPE): from each associated pose to the one nearest to an interval later, as
/// evaluate_rpe.py --fixed_delta chooses it, the motion P of the estimate against the motion Q of the
/// truth: the translation and the angle of Q⁻¹·P, as the paper and evo define it. (The script takes
/// P·Q⁻¹, whose translation differs by the rotation error times the motion.) Independent of the
/// frames of both trajectories. No interval is taken that begins less than its length before the end.
/// @return nothing if the trajectory is shorter than the interval
/// @throws Error (misuse) for an interval that is not positive
std::optional<RelativeError> relative_error(const Trajectory& estimate, const Trajectory& truth,
                                            const PosePairs& pairs,
                                            const RelativeInterval& interval);

}  // namespace cairn
