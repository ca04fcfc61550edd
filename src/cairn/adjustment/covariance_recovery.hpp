// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "cairn/core/execution.hpp"
#include "cairn/geometry/rigid3.hpp"

namespace cairn {

/// An observation of a landmark, linearised: derivatives of its residuals (pixel u, v, and depth; zeros
/// where that is not measured), which are in standard deviations.
struct LinearObservation {
  std::uint32_t frame = 0;
  /// What it adds to the information, 1 if it is independent of the others.
  double share = 1.0;
  Eigen::Matrix3d by_point = Eigen::Matrix3d::Zero();  ///< in the world
  /// Left perturbation (δt, δφ) of world_from_camera.
  Eigen::Matrix<double, 3, 6> by_pose = Eigen::Matrix<double, 3, 6>::Zero();
};

struct LinearLandmark {
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
  /// Information on the position that no observation gives.
  Eigen::Matrix3d prior = Eigen::Matrix3d::Zero();
  std::vector<LinearObservation>
      observations;  ///< of distinct frames; none: no covariance is asked for
};

/// A linearised least-squares problem of camera poses and landmarks. Frame 0 is where it is.
struct LinearProblem {
  std::vector<Eigen::Vector3d> camera_centres;  ///< one a frame
  std::vector<LinearLandmark> landmarks;
  /// A frame whose distance from frame 0 is held, where nothing else determines the scale.
  std::optional<std::uint32_t> scale_frame;
  /// Information added to each number of each pose, so that a frame that nothing ties to the others is as
  /// good as unknown, not a reason to fail.
  Vector6d least_information = Vector6d::Constant(1e-6);
};

/// What landmark covariances are relative to.
enum class CovarianceGauge {
  kFirstFrame,     ///< frame 0
  kFirstObserver,  ///< the frame of the landmark's first observation
};

struct RecoveredCovariances {
  /// Of each frame's pose relative to frame 0, (δt, δφ) in the world.
  std::vector<Matrix6d> frames;
  /// Of each landmark's position, along the world's axes; zero for those without observations.
  std::vector<Eigen::Matrix3d> landmarks;
};

/// Up to so many frames the problem is solved densely; more of them by sparse factors.
inline constexpr std::size_t kMostDenseFrames = 800;

/// Marginal covariances of poses and landmarks: landmarks are eliminated, the reduced system of the
/// poses is inverted, as far as landmarks see pairs of frames.
/// @param most_dense up to so many frames, all pairs
/// @throws Error (input) if more pairs of frames share landmarks than memory should hold, (cancelled)
RecoveredCovariances recover_covariances(const LinearProblem& problem, CovarianceGauge gauge,
                                         const Execution& execution = {},
                                         std::size_t most_dense = kMostDenseFrames);

}  // namespace cairn
