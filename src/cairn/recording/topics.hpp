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

/// An image topic.
struct ImageTopic {
  std::uint32_t topic = 0;  ///< position in Recording::topics()
  bool is_depth = false;
  std::string frame;               ///< frame of the first image
  std::optional<CameraInfo> info;  ///< from the camera_info topic beside it, or with its frame
};

/// The readable image topics (ROS 1 or CDR), sorted by name. Compressed copies of recorded raw
/// images are left out.
std::vector<ImageTopic> image_topics(const Recording& recording);

/// The topics of one RGB-D or stereo camera.
struct SensorTopics {
  ImageTopic image;  ///< colour image or left image
  ImageTopic depth_or_right;

  bool is_stereo() const { return !depth_or_right.is_depth; }
};

/// Chooses the only image and the only depth image, or else the only two images as a stereo pair.
/// @param topics result of image_topics()
/// @param given topic names "IMAGE,DEPTH" or "LEFT,RIGHT"; empty: automatic choice
/// @throws Error (input) naming the topics if there is more than one choice or none
SensorTopics choose_topics(const Recording& recording, const std::vector<ImageTopic>& topics,
                           const std::string& given = {});

/// Pose of the second camera in the frame of the first, metres. A stereo pair uses R and P of
/// CameraInfo; without a baseline in P, and for RGB-D, /tf_static is used. RealSense's own recordings
/// state the poses of their streams instead. std::nullopt if unknown.
/// @throws Error (input) for an R that is not a rotation
std::optional<Rigid3> image_from_partner(const Recording& recording, const SensorTopics& topics);

/// Length of one unit of a topic of 16-bit depth, metres, if the recording states it, as RealSense's
/// own recordings do.
/// @throws Error (input) for a length that is not positive
std::optional<double> depth_unit_m(const Recording& recording, const ImageTopic& depth);

/// Transform target_from_source by /tf_static; identity for equal frames; std::nullopt if unknown.
std::optional<Rigid3> static_transform(const Recording& recording, const std::string& target,
                                       const std::string& source);

/// Whether the name contains "image_rect", image_proc's name for rectified images.
bool is_rectified_topic(const std::string& name);

/// A readable pose topic: nav_msgs/Odometry, geometry_msgs/PoseStamped, PoseWithCovarianceStamped, or
/// tf2_msgs/TFMessage other than /tf_static.
struct PoseTopic {
  std::string name;
  std::string body;      ///< frame that the poses describe; empty if not in the first message
  bool is_tree = false;  ///< transforms of any frames, as on /tf
};

/// The readable pose topics, sorted by name.
std::vector<PoseTopic> pose_topics(const Recording& recording);

/// Poses world_from_camera. Timestamps come from the message headers.
/// From a topic of body poses and /tf_static: the world is the topic's parent frame.
/// From a topic of transforms and /tf_static: the world is the topmost frame above the camera, or the
/// given one. The poses are at the times of the most frequent transform between the two; the other
/// transforms are interpolated.
/// @param given "TOPIC", or "TOPIC,FRAME" with the body's frame; for transforms the world's frame
/// @param camera_frame frame of the camera's images
/// @throws Error (input) naming the choices for another topic; if the body's frame or its transform
///         to the camera is unknown; for messages in several frames; if the transforms do not move
///         the camera in the world
Trajectory camera_poses(const Recording& recording, const std::string& given,
                        const std::string& camera_frame);

}  // namespace cairn
