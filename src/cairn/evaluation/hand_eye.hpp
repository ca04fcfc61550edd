// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <optional>
#include <string>

#include "cairn/geometry/rigid3.hpp"
#include "cairn/geometry/similarity3.hpp"
#include "cairn/geometry/trajectory.hpp"

namespace cairn {

inline constexpr double kMaxClockOffset = 0.2;  ///< default of estimate_hand_eye(), seconds

/// Transform between the camera and the body that the truth tracks, such as markers of motion capture.
struct HandEye {
  Rigid3 body_from_camera;
  /// Covariance of body_from_camera: left perturbation (δt, δφ). Estimated from the differences
  /// between parts of the sequence, so slow drift of the estimate is included.
  Matrix6d covariance = Matrix6d::Zero();
  /// Clock of the truth minus clock of the estimate; 0 if not estimated.
  double clock_offset_s = 0.0;
  double clock_offset_deviation_s = 0.0;  ///< standard deviation
  Similarity3 truth_from_estimate;        ///< between the two world frames
  std::size_t poses = 0;                  ///< number of compared poses
};

struct HandEyeResult {
  std::optional<HandEye> hand_eye;
  std::string reason;  ///< why there is no result; empty if there is one
};

/// Estimates the constant transform between the camera and the body that the truth tracks, the
/// clock offset, and the transform between the world frames. Minimises the differences between
/// world_from_body(t + offset)·body_from_camera and truth_from_estimate·world_from_camera(t) in
/// orientation and position.
///
/// Initial values: the rotation in closed form from the axes of relative rotations (Park and
/// Martin, 1994), the translations by linear least squares, the clock offset by search.
/// Gauss-Newton with Huber's kernel then refines all parameters. Residuals of position and
/// orientation are divided by their median deviations. The truth is interpolated over gaps of up to
/// 0.1 s.
/// @param max_clock_offset_s largest clock offset between the trajectories; 0: one clock; at most 10
/// @param with_scale         estimates the scale, for an estimate in a different unit than the
///        truth
/// @throws Error (misuse) naming the argument
HandEyeResult estimate_hand_eye(const Trajectory& estimate, const Trajectory& truth,
                                double max_clock_offset_s = kMaxClockOffset,
                                bool with_scale = false);

/// True poses of the camera instead of the body, timed by the estimate's clock.
Trajectory corrected_truth(const Trajectory& truth, const HandEye& hand_eye);

}  // namespace cairn
