// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "cairn/core/statistics.hpp"
#include "cairn/geometry/similarity3.hpp"
#include "cairn/geometry/trajectory.hpp"

// Errors of an estimated trajectory, as defined by the TUM RGB-D benchmark (Sturm et al., IROS 2012) and
// evo.
namespace cairn {

/// Alignment of the estimate with the truth before the comparison.
enum class TrajectoryAlignment {
  kNone,    ///< both are in one frame already
  kOrigin,  ///< the first poses coincide
  kSe3,     ///< rotation and translation by least squares over all positions
  kSim3,    ///< the same with scale
  /// Chordal mean rotation from the orientations, then mean translation. Determined for any path,
  /// if both trajectories belong to one camera body.
  kPoses,
};

struct AbsoluteError {
  Similarity3 truth_from_estimate;    ///< the alignment
  ErrorStatistics translation;        ///< distances between positions, in the truth's unit
  ErrorStatistics rotation_rad;       ///< angles between orientations
  std::vector<double> translations;   ///< one per pair
  std::vector<double> rotations_rad;  ///< one per pair
};

/// Absolute trajectory error (ATE) over the pairs of poses.
/// @param pairs (estimate, truth); see associate()
/// @return std::nullopt for fewer pairs than the alignment needs: 1, or 3 for kSe3 and kSim3
std::optional<AbsoluteError> absolute_error(const Trajectory& estimate, const Trajectory& truth,
                                            const PosePairs& pairs, TrajectoryAlignment alignment);

/// Interval of a relative error.
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

/// Relative pose error (RPE). Each associated pose is paired with the pose nearest to one interval
/// later, as in evaluate_rpe.py --fixed_delta. Between them, the estimate moves by P and the truth
/// by Q. The error is the translation and angle of Q⁻¹·P, as in Sturm et al. and evo. (The script
/// uses P·Q⁻¹; its translation differs by the rotation error times the motion.) The error is
/// independent of the frames of both trajectories. Intervals that would extend beyond the end are
/// left out.
/// @return std::nullopt if the trajectory is shorter than the interval
/// @throws Error (misuse) for an interval that is not positive
std::optional<RelativeError> relative_error(const Trajectory& estimate, const Trajectory& truth,
                                            const PosePairs& pairs,
                                            const RelativeInterval& interval);

struct TrajectoryEvaluationOptions {
  TrajectoryAlignment alignment = TrajectoryAlignment::kSe3;
  double max_time_difference_s = 0.02;  ///< largest time difference of paired poses; positive
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
  /// One per interval of the options; std::nullopt if the trajectory is shorter than the interval
  /// or could not be aligned.
  std::vector<std::optional<RelativeError>> relative;
};

/// Pairs the poses by time, aligns the estimate and computes all errors. Relative errors depend on
/// the alignment only through its scale: with kSim3 they are in the truth's scale.
TrajectoryEvaluation evaluate_trajectory(const Trajectory& estimate, const Trajectory& truth,
                                         const TrajectoryEvaluationOptions& options = {});

}  // namespace cairn
