// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "cairn/geometry/rigid3.hpp"
#include "cairn/odometry/sensor_model.hpp"

namespace cairn {

/// A landmark and the measurement taken to be of it.
struct PointMatch {
  Eigen::Vector3d x_in_world = Eigen::Vector3d::Zero();
  PointMeasurement measured;
};

struct PoseEstimate {
  Rigid3 world_from_camera;
  Matrix6d covariance = Matrix6d::Zero();  ///< as Cairn's pose covariances: δt, δφ in the world
  std::vector<bool> inliers;               ///< one a match
  std::size_t inlier_count = 0;
};

/// The pose that minimises the robust (Huber) sum of squared residuals, from a start nearby. Matches
/// whose pixel residual the noise does not explain (99 %) are dropped and taken back as the pose
/// settles; a depth that disagrees is ignored, not its match.
PoseEstimate refine_pose(const Pinhole& pinhole, std::span<const PointMatch> matches,
                         const Rigid3& world_from_camera);

/// The pose that most matches agree with, from no start: random triples with depth (seeded), then
/// refined. Nothing if fewer than `least_inliers` agree.
std::optional<PoseEstimate> find_pose(const Pinhole& pinhole, std::span<const PointMatch> matches,
                                      std::size_t least_inliers, std::uint64_t seed);

}  // namespace cairn
