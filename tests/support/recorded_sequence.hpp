// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "cairn/core/file.hpp"
#include "cairn/vision/sequence.hpp"

#include "support/recordings.hpp"

namespace cairn::testing {

/// A camera as ROS states it.
/// @param baseline_m of a right camera, from the left one
inline CameraInfo camera_info(const Camera& camera, const std::string& frame,
                              double baseline_m = 0.0) {
  const std::vector<double>& p = camera.parameters;
  CameraInfo info;
  info.header.frame = frame;
  info.width = camera.width;
  info.height = camera.height;
  info.distortion_model = "plumb_bob";
  info.distortion.assign(p.begin() + 4, p.end());
  info.distortion.resize(5);
  info.intrinsics = {p[0], 0, p[2], 0, p[1], p[3], 0, 0, 1};
  info.projection = {p[0], 0, p[2], -p[0] * baseline_m, 0, p[1], p[3], 0, 0, 0, 1, 0};
  return info;
}

/// How the images of a sequence become messages.
enum class Recorded {
  kRaw,         ///< pixels; depth in metres
  kCompressed,  ///< the files, if the sequence is a folder; depth in the folder's units
};

/// A sequence in a folder as messages of an RGB-D or stereo camera, with its CameraInfo.
/// @param encoding of MessageFields
inline WrittenMessages recorded(const ImageSequence& sequence, const Camera& camera,
                                const std::string& encoding, Recorded how = Recorded::kRaw) {
  WrittenMessages messages;
  const auto add_image = [&](const std::string& topic, double time_s, const ImageMessage& image) {
    const std::uint64_t time_ns = 1000 * static_cast<std::uint64_t>(std::llround(1e6 * time_s));
    messages.push_back({topic,
                        image.is_compressed ? "sensor_msgs/CompressedImage" : "sensor_msgs/Image",
                        time_ns, image_bytes(encoding, time_ns, image)});
  };
  const auto add_color = [&](const std::string& topic, double time_s,
                             const std::filesystem::path& file) {
    ImageMessage message;
    message.header.frame = topic;
    ColorImage pixels;
    std::string bytes;
    if (how == Recorded::kCompressed) {
      message.is_compressed = true;
      message.encoding = file.extension() == ".png" ? "bgr8; png compressed" : "jpeg";
      bytes = read_file(file);
      message.data = bytes;
      return add_image(topic + "/compressed", time_s, message);
    }
    pixels = read_color_image(file);
    message.encoding = encoding == "ros1" ? "bgr8" : "rgb8";
    message.width = pixels.width;
    message.height = pixels.height;
    message.row_bytes = 3 * pixels.width + 5;  // rows may be padded
    for (std::uint32_t v = 0; v < pixels.height; ++v) {
      for (std::uint32_t u = 0; u < pixels.width; ++u) {
        const std::uint8_t* const bgr = &pixels.at(u, v);
        for (int i = 0; i < 3; ++i) bytes += static_cast<char>(bgr[encoding == "ros1" ? i : 2 - i]);
      }
      bytes.append(5, '\x7f');
    }
    message.data = bytes;
    add_image(topic, time_s, message);
  };
  const auto add_depth = [&](const std::string& topic, double time_s,
                             const std::filesystem::path& file) {
    ImageMessage message;
    message.header.frame = topic;
    std::string bytes;
    if (how == Recorded::kCompressed) {
      message.is_compressed = true;
      message.encoding = "16UC1; compressedDepth png";
      bytes = std::string(12, '\0') + read_file(file);
      message.data = bytes;
      return add_image(topic + "/compressedDepth", time_s, message);
    }
    const DepthImage depth = metric_depth(read_depth_image(file), sequence.depth_units_per_metre());
    message.encoding = "32FC1";
    message.is_big_endian = encoding == "cdr-be";
    message.width = depth.width;
    message.height = depth.height;
    message.row_bytes = 4 * depth.width;
    for (const float metres : depth.values) {
      auto value = std::bit_cast<std::array<char, 4>>(metres > 0.0F ? metres : NAN);
      if (message.is_big_endian) std::reverse(value.begin(), value.end());
      bytes.append(value.data(), value.size());
    }
    message.data = bytes;
    add_image(topic, time_s, message);
  };
  const std::string second = sequence.is_stereo() ? "/cam/right" : "/cam/depth";
  const auto add_info = [&](const std::string& name, double baseline_m) {
    messages.push_back(
        {name + "/camera_info", "sensor_msgs/CameraInfo", 0,
         camera_info_bytes(encoding, camera_info(camera, name + "/image", baseline_m))});
  };
  add_info("/cam/left", 0.0);
  add_info(second, sequence.baseline_m());
  for (const SequenceFrame& frame : sequence.frames()) {
    add_color("/cam/left/image", frame.timestamp_s, frame.color);
    if (frame.depth) add_depth(second + "/image", frame.timestamp_s, *frame.depth);
    if (frame.right) add_color(second + "/image", frame.timestamp_s, *frame.right);
  }
  return messages;
}

}  // namespace cairn::testing
