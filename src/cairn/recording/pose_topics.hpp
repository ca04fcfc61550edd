// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "cairn/geometry/trajectory.hpp"
#include "cairn/recording/recording.hpp"

namespace cairn {

/// A readable pose topic: nav_msgs/Odometry, geometry_msgs/PoseStamped or
/// PoseWithCovarianceStamped.
struct PoseTopic {
  std::string name;
  std::string body;  ///< frame that the poses describe; empty if not in the first message
};

/// The readable pose topics, sorted by name.
std::vector<PoseTopic> pose_topics(const Recording& recording);

/// Poses world_from_camera from a topic of body poses and /tf_static; the world is the topic's
/// parent frame. Timestamps come from the message headers.
/// @param given "TOPIC", or "TOPIC,FRAME" with the body's frame
/// @param camera_frame frame of the camera's images
/// @throws Error (input) naming the choices for another topic; if the body's frame or its transform
///         to the camera is unknown; for messages in several frames
Trajectory camera_poses(const Recording& recording, const std::string& given,
                        const std::string& camera_frame);

}  // namespace cairn
