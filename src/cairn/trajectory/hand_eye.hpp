// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <optional>
#include <string>

#include "cairn/geometry/rigid3.hpp"
#include "cairn/geometry/similarity3.hpp"
#include "cairn/trajectory/trajectory.hpp"

namespace cairn {

struct HandEyeOptions {
  /// The clocks of the two trajectories differ by at most so much; 0: they are one clock. At most 10.
  double max_clock_offset_s = 0.2;
  /// The truth is interpolated over gaps of at most so much; positive.
  double max_gap_s = 0.1;
  bool with_scale = false;  ///< the estimate's unit is not the truth's

  /// @throws Error (misuse) naming the field
  void validate() const;
};

/// How the body whose poses the truth gives, such as the markers of motion capture, is mounted to the camera.
struct HandEye {
  Rigid3 body_from_camera;
  /// Of that pose: left perturbation, (δt, δφ). From how much the parts of the sequence differ, so that slow
  /// drift of the estimate counts.
  Matrix6d covariance = Matrix6d::Zero();
  /// What the truth's clock shows more than the estimate's at the same moment; 0 if not estimated.
  double clock_offset_s = 0.0;
  double clock_offset_deviation_s = 0.0;  ///< standard deviation
  Similarity3 truth_from_estimate;        ///< of the two worlds
  std::size_t poses = 0;                  ///< that were compared
};

struct HandEyeResult {
  std::optional<HandEye> hand_eye;
  std::string reason;  ///< why there is none; empty if there is one
};

/// The constant offset between the camera and the body whose poses the truth gives, the offset of their clocks
/// and the transform of their worlds: for which world_from_body(t + offset)·body_from_camera and
/// truth_from_estimate·world_from_camera(t) agree best, in orientation and position.
///
/// Start in closed form: the rotation from the axes of relative rotations (Park and Martin, 1994), the
/// translations by linear least squares; the clock offset by trial. Then Gauss-Newton of all at once, residuals
/// of position and of orientation over their median deviations, with Huber's kernel.
HandEyeResult estimate_hand_eye(const Trajectory& estimate, const Trajectory& truth,
                                const HandEyeOptions& options = {});

/// The truth of the camera instead of the body, at the times of the estimate's clock.
Trajectory corrected_truth(const Trajectory& truth, const HandEye& hand_eye);

}  // namespace cairn
