// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <string_view>

#include "cairn/core/file.hpp"
#include "cairn/geometry/rigid3.hpp"
#include "cairn/map/camera_calibration.hpp"

namespace cairn {

namespace detail {
class McapWriter;
}  // namespace detail

/// Writes images, cameras and poses as an MCAP recording of ROS 2 (CDR messages with their
/// definitions), which ROS, Foxglove and `cairn map` read. Messages are written in the order of the
/// calls.
class Ros2RecordingWriter {
 public:
  explicit Ros2RecordingWriter(ByteSink sink);
  ~Ros2RecordingWriter();

  /// Header of a message: its measurement time, also used as its recording time, and its frame.
  struct Stamp {
    std::uint64_t time_ns = 0;  ///< since 1970, before 2106
    std::string_view frame;
  };

  /// sensor_msgs/CameraInfo.
  void add_camera(const std::string& topic, const Stamp& stamp,
                  const CameraCalibration& calibration);
  /// sensor_msgs/Image without padding.
  /// @param encoding as sensor_msgs/image_encodings, e.g. "bgr8", "16UC1"; numbers are little-endian
  void add_image(const std::string& topic, const Stamp& stamp, std::uint32_t width,
                 std::uint32_t height, std::string_view encoding, std::string_view data);
  /// sensor_msgs/CompressedImage of a JPEG file's bytes.
  void add_jpeg(const std::string& topic, const Stamp& stamp, std::string_view data);
  /// geometry_msgs/PoseStamped, in the stamp's frame.
  void add_pose(const std::string& topic, const Stamp& stamp, const Rigid3& pose);
  /// Completes the file; no further message may follow.
  void finish();

 private:
  void add(const std::string& topic, const std::string& type, std::uint64_t time_ns,
           std::string_view data);

  std::unique_ptr<detail::McapWriter> file_;
  std::map<std::string, std::uint16_t> schemas_;   // by type
  std::map<std::string, std::uint16_t> channels_;  // by topic
};

/// The ROS calibration of a camera.
/// @param baseline_m of the right camera of a stereo pair, from the left camera
/// @throws Error (misuse) for a model without a ROS equivalent
CameraCalibration ros_calibration(const Camera& camera, double baseline_m = 0.0);

}  // namespace cairn
