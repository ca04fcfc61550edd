// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "cairn/geometry/rigid3.hpp"
#include "cairn/vision/detail/row_motion.hpp"
#include "cairn/vision/detail/sensor_model.hpp"

namespace cairn::detail {

/// A landmark and the measurement matched with it.
struct PointMatch {
  Eigen::Vector3d x_in_world = Eigen::Vector3d::Zero();
  PointMeasurement measured;
};

struct PoseEstimate {
  Rigid3 world_from_camera;
  Matrix6d covariance = Matrix6d::Zero();  ///< as Cairn's pose covariances: δt, δφ in the world
  std::vector<bool> inliers;               ///< one per match
  std::size_t inlier_count = 0;
};

/// Minimises the robust (Huber) sum of squared residuals from an initial pose. Matches whose pixel residual
/// exceeds the noise (99 %) are excluded, and included again if the pose changes; a contradictory depth is
/// ignored without excluding its match.
PoseEstimate refine_pose(const Pinhole& pinhole, std::span<const PointMatch> matches,
                         const Rigid3& world_from_camera);

/// One of several cameras that are fixed to one body.
struct BodyCamera {
  Pinhole pinhole;
  Rigid3 camera_from_body;
  std::span<const PointMatch> matches;
};

/// The same for a body with several cameras: estimates world_from_body in place of world_from_camera.
/// @return inliers: those of the first camera's matches, then those of the next
PoseEstimate refine_pose(std::span<const BodyCamera> cameras, const Rigid3& world_from_body);

/// By how much the covariance of a pose grows without those landmarks, one after another, without which the position is
/// least certain. A pose that rests on a few landmarks is wrong if one of them is.
/// @param cameras   with the matches that count
/// @param landmarks one per match, in the order of PoseEstimate::inliers
/// @param count     number of landmarks to leave out
/// @return std::nullopt if the others do not determine the pose
std::optional<Matrix6d> growth_without_landmarks(std::span<const BodyCamera> cameras,
                                                 std::span<const std::uint32_t> landmarks,
                                                 const Rigid3& world_from_body, std::size_t count);

/// What is known of the camera's motion during a readout before its rows are compared.
struct RowMotionPrior {
  RowMotion motion;
  double sigma_m_s = 0.0;    ///< per axis of the velocity; positive
  double sigma_rad_s = 0.0;  ///< per axis of the turn; positive
};

/// The motion during the readout that, together with the pose, best explains where the rows see the landmarks.
/// @param matches measured pixels and depths, corrected for the prior motion
/// @param rows    row of each match in the original image
RowMotion refined_row_motion(const Pinhole& pinhole, std::span<const PointMatch> matches,
                             std::span<const double> rows, const RowMotionPrior& prior,
                             const Rigid3& world_from_camera);

/// Finds the pose that most matches agree with, without an initial pose: random triples with depth
/// (seeded), then refinement. std::nullopt if fewer than `least_inliers` agree.
std::optional<PoseEstimate> find_pose(const Pinhole& pinhole, std::span<const PointMatch> matches,
                                      std::size_t least_inliers, std::uint64_t seed);

}  // namespace cairn::detail
