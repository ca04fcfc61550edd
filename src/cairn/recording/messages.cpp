// SPDX-License-Identifier: BSD-3-Clause
// Messages of ROS, in its two encodings: https://wiki.ros.org/msg and CDR of the Object Management Group (version 1).
#include "cairn/recording/messages.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <span>

#include <fmt/format.h>

#include "cairn/core/error.hpp"

namespace cairn {
namespace {

// Reads the fields of a message in order. CDR aligns numbers to their size, and ends texts with a zero.
class MessageCursor {
 public:
  explicit MessageCursor(const MessageBytes& message)
      : name_(message.name), bytes_(message.bytes), is_cdr_(message.encoding == "cdr") {
    reject_if(!is_cdr_ && message.encoding != "ros1", name_,
              "a message encoded as " + printable(message.encoding), "cdr or ros1");
    if (!is_cdr_) return;
    const std::string_view head = take(kCdrHead, "encapsulation");
    const bool is_plain = head[0] == 0 && (head[1] == 0 || head[1] == 1);
    reject_if(!is_plain, name_, "an encapsulation " + printable(head.substr(0, 2)),
              "plain CDR: 00 00 or 00 01");
    is_big_endian_ = head[1] == 0;
  }

  template <class Number>
  Number number(std::string_view field) {
    if (is_cdr_) {
      const std::size_t past = (at_ - kCdrHead) % sizeof(Number);
      if (past != 0) take(sizeof(Number) - past, field);
    }
    std::array<char, sizeof(Number)> value;
    std::memcpy(value.data(), take(sizeof(Number), field).data(), value.size());
    if (is_big_endian_ != (std::endian::native == std::endian::big)) {
      std::reverse(value.begin(), value.end());
    }
    return std::bit_cast<Number>(value);
  }

  std::string text(std::string_view field) {
    std::string_view value = data(field);
    if (is_cdr_ && value.ends_with('\0')) value.remove_suffix(1);
    return std::string(value);
  }

  // A list of bytes.
  std::string_view data(std::string_view field) {
    const auto size = number<std::uint32_t>(field);
    return take(size, field);
  }

  void doubles(std::span<double> values, std::string_view field) {
    for (double& value : values) value = number<double>(field);
  }

  // A length of a list, whose elements have at least `least` bytes each.
  std::size_t count(std::size_t least, std::string_view field) {
    const auto stated = number<std::uint32_t>(field);
    reject_if(stated > (bytes_.size() - at_) / least, place(field),
              fmt::format("{} elements, for which too few bytes are left", stated),
              "an undamaged message");
    return stated;
  }

  double stamp() {
    if (!is_cdr_) number<std::uint32_t>("header.seq");
    const auto seconds = number<std::uint32_t>("header.stamp");
    const auto nanoseconds = number<std::uint32_t>("header.stamp");
    return seconds + 1e-9 * nanoseconds;
  }

  MessageHeader header() {
    MessageHeader header;
    header.stamp_s = stamp();
    header.frame = text("header.frame_id");
    return header;
  }

  // Translation and quaternion x y z w.
  Rigid3 pose() {
    std::array<double, 3> translation = {};
    std::array<double, 4> xyzw = {};
    doubles(translation, "translation");
    doubles(xyzw, "rotation");
    const Eigen::Quaterniond rotation(xyzw[3], xyzw[0], xyzw[1], xyzw[2]);
    constexpr double kTolerance = 1e-3;
    reject_if(!(std::abs(rotation.norm() - 1.0) <= kTolerance), place("rotation"),
              fmt::format("a quaternion of norm {}", rotation.norm()), "of norm 1");
    return {rotation, Eigen::Vector3d(translation[0], translation[1], translation[2])};
  }

  std::string place(std::string_view field) const {
    return fmt::format("{}: byte {}: {}", name_, at_, field);
  }

 private:
  static constexpr std::size_t kCdrHead = 4;

  std::string_view take(std::size_t count, std::string_view field) {
    reject_if(count > bytes_.size() - at_, place(field),
              fmt::format("the message ends after {} bytes", bytes_.size()),
              fmt::format("{} more", count));
    const std::string_view taken = bytes_.substr(at_, count);
    at_ += count;
    return taken;
  }

  const std::string& name_;
  std::string_view bytes_;
  std::size_t at_ = 0;
  bool is_cdr_;
  bool is_big_endian_ = false;
};

}  // namespace

double stamp_of(const MessageBytes& message) {
  return MessageCursor(message).stamp();
}

ImageMessage parse_image(const MessageBytes& message, std::string_view type) {
  MessageCursor cursor(message);
  ImageMessage image;
  image.header = cursor.header();
  image.is_compressed = type == "sensor_msgs/CompressedImage";
  if (image.is_compressed) {
    image.encoding = cursor.text("format");
  } else {
    image.height = cursor.number<std::uint32_t>("height");
    image.width = cursor.number<std::uint32_t>("width");
    image.encoding = cursor.text("encoding");
    image.is_big_endian = cursor.number<std::uint8_t>("is_bigendian") != 0;
    image.row_bytes = cursor.number<std::uint32_t>("step");
  }
  image.data = cursor.data("data");
  return image;
}

CameraInfo parse_camera_info(const MessageBytes& message) {
  MessageCursor cursor(message);
  CameraInfo info;
  info.header = cursor.header();
  info.height = cursor.number<std::uint32_t>("height");
  info.width = cursor.number<std::uint32_t>("width");
  info.distortion_model = cursor.text("distortion_model");
  info.distortion.resize(cursor.count(sizeof(double), "d"));
  cursor.doubles(info.distortion, "d");
  cursor.doubles(info.intrinsics, "k");
  cursor.doubles(info.rectification, "r");
  cursor.doubles(info.projection, "p");
  return info;
}

std::vector<FrameTransform> parse_transforms(const MessageBytes& message) {
  MessageCursor cursor(message);
  constexpr std::size_t kLeast = 7 * sizeof(double);
  const std::size_t count = cursor.count(kLeast, "transforms");
  std::vector<FrameTransform> transforms;
  for (std::size_t i = 0; i < count; ++i) {
    const MessageHeader header = cursor.header();
    const std::string child = cursor.text("child_frame_id");
    transforms.push_back({header.stamp_s, header.frame, child, cursor.pose()});
  }
  return transforms;
}

Rigid3 parse_transform(const MessageBytes& message) {
  return MessageCursor(message).pose();
}

float parse_float(const MessageBytes& message) {
  return MessageCursor(message).number<float>("data");
}

FrameTransform parse_pose(const MessageBytes& message, std::string_view type) {
  MessageCursor cursor(message);
  const MessageHeader header = cursor.header();
  const std::string child = type == "nav_msgs/Odometry" ? cursor.text("child_frame_id") : "";
  return {header.stamp_s, header.frame, child, cursor.pose()};
}

}  // namespace cairn
