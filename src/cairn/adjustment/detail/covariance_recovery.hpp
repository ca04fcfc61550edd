// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "cairn/adjustment/adjust.hpp"
#include "cairn/geometry/rigid3.hpp"

namespace cairn::detail {

/// A linearised observation of a landmark: derivatives of its residuals (pixel u, v, and depth; zero if not
/// measured), in standard deviations.
struct LinearObservation {
  std::uint32_t frame = 0;
  /// Share of the observation's information that counts; 1 if its error is independent of the others.
  double share = 1.0;
  Eigen::Matrix3d by_point = Eigen::Matrix3d::Zero();  ///< with respect to the point in the world
  /// With respect to the left perturbation (δt, δφ) of world_from_camera.
  Eigen::Matrix<double, 3, 6> by_pose = Eigen::Matrix<double, 3, 6>::Zero();
};

struct LinearLandmark {
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
  /// Prior information on the position.
  Eigen::Matrix3d prior = Eigen::Matrix3d::Zero();
  std::vector<LinearObservation> observations;  ///< if empty, no covariance is computed
};

/// A linearised least-squares problem of camera poses and landmarks. Frame 0 is fixed.
struct LinearProblem {
  std::vector<Eigen::Vector3d> camera_centres;  ///< one per frame
  std::vector<LinearLandmark> landmarks;
  /// A frame whose distance from frame 0 is fixed, if no depth determines the scale.
  std::optional<std::uint32_t> scale_frame;
  /// Information added to each pose parameter. A frame without ties to the others then has a huge
  /// covariance instead of making the problem singular.
  Vector6d least_information = Vector6d::Constant(1e-6);
};

struct RecoveredCovariances {
  /// Per frame: covariance of its pose relative to frame 0, (δt, δφ) in the world.
  std::vector<Matrix6d> frames;
  /// Per landmark: covariance of its position, along the world's axes; zero without observations.
  std::vector<Eigen::Matrix3d> landmarks;
};

/// Largest number of frames for which the problem is solved densely. Larger problems are solved by sparse
/// factors.
inline constexpr std::size_t kMostDenseFrames = 800;

/// Marginal covariances of poses and landmarks: eliminates the landmarks and inverts the reduced system of
/// the poses, for the pairs of frames that share landmarks.
/// @param most_dense up to this many frames, the system is inverted for all pairs of frames
/// @throws Error (input) if too many pairs of frames share landmarks for the memory, (cancelled)
RecoveredCovariances recover_covariances(const LinearProblem& problem, CovarianceGauge gauge,
                                         const Execution& execution = {},
                                         std::size_t most_dense = kMostDenseFrames);

}  // namespace cairn::detail
