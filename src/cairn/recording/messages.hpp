// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "cairn/geometry/rigid3.hpp"
#include "cairn/map/camera_calibration.hpp"

namespace cairn {

/// A serialised message.
struct MessageBytes {
  std::string_view bytes;
  std::string_view encoding;  ///< "cdr" or "ros1"
  std::string name;           ///< name of the message in errors
};

/// Time and frame of a measurement.
struct MessageHeader {
  double stamp_s = 0.0;
  std::string frame;
};

/// sensor_msgs/Image or CompressedImage.
struct ImageMessage {
  MessageHeader header;
  bool is_compressed = false;
  std::uint32_t width = 0;  ///< pixels; 0 for a compressed image
  std::uint32_t height = 0;
  std::string encoding;  ///< see sensor_msgs/image_encodings; for a compressed image its format
  bool is_big_endian = false;
  std::uint32_t row_bytes = 0;
  std::string_view data;  ///< view into the message's bytes
};

/// sensor_msgs/CameraInfo.
struct CameraInfo : CameraCalibration {
  MessageHeader header;
};

/// One transform of a tf2_msgs/TFMessage, or a pose message.
struct FrameTransform {
  double stamp_s = 0.0;
  std::string parent;
  std::string child;  ///< empty if not in the message
  Rigid3 parent_from_child;
};

/// Timestamp, seconds, of a message that begins with a header; parses only the stamp.
/// @throws Error (input) naming message and byte
double stamp_of(const MessageBytes& message);
/// @param type "sensor_msgs/Image" or "sensor_msgs/CompressedImage"
/// @throws Error (input) naming message, byte and field
ImageMessage parse_image(const MessageBytes& message, std::string_view type);
CameraInfo parse_camera_info(const MessageBytes& message);
std::vector<FrameTransform> parse_transforms(const MessageBytes& message);
/// geometry_msgs/Transform.
Rigid3 parse_transform(const MessageBytes& message);
/// std_msgs/Float32.
float parse_float(const MessageBytes& message);
/// @param type "nav_msgs/Odometry", "geometry_msgs/PoseStamped" or
///        "geometry_msgs/PoseWithCovarianceStamped"; only the first contains the child
FrameTransform parse_pose(const MessageBytes& message, std::string_view type);

}  // namespace cairn
