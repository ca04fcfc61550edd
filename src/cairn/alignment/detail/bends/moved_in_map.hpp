// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>

#include "cairn/geometry/covariance.hpp"
#include "cairn/geometry/similarity3.hpp"
#include "cairn/map/landmark_map.hpp"

namespace cairn {

/// Moves one keyframe. Its camera turns, too.
inline void move_keyframe(FrameTable& frames, std::size_t i, const Similarity3& motion) {
  auto& q = frames.quaternions[i];
  const Eigen::Quaterniond turned =
      motion.rigid().quaternion() * Eigen::Quaterniond(q[0], q[1], q[2], q[3]);
  q = {turned.w(), turned.x(), turned.y(), turned.z()};
  frames.translations[i] = motion * frames.translations[i];
}

/// Moves one landmark, with its covariance if the map has them.
inline void move_landmark(LandmarkTable& landmarks, bool has_covariances, std::size_t i,
                          const Similarity3& motion) {
  landmarks.positions[i] = motion * landmarks.positions[i];
  if (!has_covariances) return;
  landmarks.covariances[i] =
      motion.scale() * motion.scale() *
      rotated_covariance(landmarks.covariances[i], motion.rigid().rotation());
}

}  // namespace cairn
