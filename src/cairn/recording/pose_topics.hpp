// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "cairn/geometry/trajectory.hpp"
#include "cairn/recording/recording.hpp"

namespace cairn {

/// A topic of poses that can be read: nav_msgs/Odometry, geometry_msgs/PoseStamped or PoseWithCovarianceStamped.
struct PoseTopic {
  std::string name;
  std::string body;  ///< frame whose poses they are; empty if the first message does not say it
};

/// By name.
std::vector<PoseTopic> pose_topics(const Recording& recording);

/// The poses of a camera by a topic of poses of the body that carries it, and by /tf_static. Times are those of the
/// messages' headers.
/// @param given "TOPIC", or "TOPIC,FRAME" with the body's frame
/// @param camera_frame of the camera's images
/// @throws Error (input) naming the choices for another topic; unless the body and where the camera is on it are known;
///         for messages in several frames
Trajectory camera_poses(const Recording& recording, const std::string& given,
                        const std::string& camera_frame);

}  // namespace cairn
