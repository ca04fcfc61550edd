// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "cairn/geometry/similarity3.hpp"
#include "cairn/trajectory/trajectory.hpp"

/// Errors of an estimated trajectory against the true one, as the TUM RGB-D benchmark (Sturm et
/// al., IROS 2012) and evo define them.
namespace cairn {

/// What several errors amount to.
struct ErrorStatistics {
  std::size_t count = 0;
  double rmse = 0.0;
  double mean = 0.0;
  double median = 0.0;
  double standard_deviation = 0.0;
  double lowest = 0.0;
  double highest = 0.0;
};

/// @return nothing of no errors
std::optional<ErrorStatistics> statistics_of(std::span<const double> errors);

/// How to bring the estimate into the frame of the truth before comparing.
enum class TrajectoryAlignment {
  kNone,    ///< both are in one frame already
  kOrigin,  ///< the first pair of poses coincides
  kSe3,     ///< least squares over all positions, rotation and translation
  kSim3,    ///< and scale
};

struct AbsoluteError {
  Similarity3 truth_from_estimate;   ///< the alignment
  ErrorStatistics translation;       ///< distances between positions, in the truth's unit
  ErrorStatistics rotation_rad;      ///< angles between orientations
  std::vector<double> translations;  ///< one a pair
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
};

struct RelativeError {
  ErrorStatistics translation;   ///< drift over the interval, in the truth's unit
  ErrorStatistics rotation_rad;  ///< angle of the drift
};

/// Relative pose error (RPE): from each associated pose to the first one at least an interval
/// later, the motion of the estimate against that of the truth. Independent of the frames of both.
/// @return nothing if no two poses are an interval apart
/// @throws Error (misuse) for an interval that is not positive
std::optional<RelativeError> relative_error(const Trajectory& estimate, const Trajectory& truth,
                                            const PosePairs& pairs,
                                            const RelativeInterval& interval);

}  // namespace cairn
