// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "cairn/geometry/trajectory.hpp"
#include "cairn/recording/messages.hpp"
#include "cairn/recording/recording.hpp"

namespace cairn {

/// A topic of images.
struct ImageTopic {
  std::uint32_t topic = 0;  ///< position in Recording::topics()
  bool is_depth = false;
  std::string frame;               ///< of the first image
  std::optional<CameraInfo> info;  ///< of the topic beside it, or else of its frame
};

/// The topics of images that can be read (ROS 1, or CDR), by name. Without transported copies of raw images that are
/// there too.
std::vector<ImageTopic> image_topics(const Recording& recording);

/// The topics of one RGB-D or stereo camera.
struct SensorTopics {
  ImageTopic image;  ///< in colour, or of the left camera
  ImageTopic depth_or_right;

  bool is_stereo() const { return !depth_or_right.is_depth; }
};

/// Chooses the only image and the only depth image, or else the only two images, which are a stereo pair.
/// @param topics as from image_topics()
/// @param given "IMAGE,DEPTH" or "LEFT,RIGHT", names of topics; empty: chosen
/// @throws Error (input) naming the topics if there is more than one choice or none
SensorTopics choose_topics(const Recording& recording, const std::vector<ImageTopic>& topics,
                           const std::string& given = {});

/// Where the second camera is, of two that are mounted on one body: of a stereo pair by P of the CameraInfo; otherwise
/// and else by /tf_static. std::nullopt if neither says it.
/// @throws Error (input) for an R that is no rotation
std::optional<Rigid3> image_from_partner(const Recording& recording, const SensorTopics& topics);

/// The transform between two frames by /tf_static; of a frame to itself the identity. std::nullopt if it is not stated.
std::optional<Rigid3> static_transform(const Recording& recording, const std::string& target,
                                       const std::string& source);

/// Whether the name says that the images are rectified, as image_proc names them.
bool is_rectified_topic(const std::string& name);

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
