// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/formats/foreign/ros2_recording.hpp"

#include <cstring>
#include <map>
#include <sstream>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/core/error.hpp"

#include "support/mcap_recording.hpp"
#include "support/refusal.hpp"

namespace cairn {
namespace {

using ::testing::HasSubstr;

const Camera kCamera{CameraId{0}, "OPENCV", 4, 2, {500, 510, 2, 1, 0.1, -0.2, 0.001, 0.002}};

testing::McapRecording some_recording() {
  std::string bytes;
  Ros2RecordingWriter writer([&](std::string_view more) { bytes += more; });
  writer.add_camera("/info", {1'500'000'000, "odd"}, ros_calibration(kCamera, 0.2));
  writer.add_image("/depth", {1'500'000'000, "odd"}, 4, 2, "16UC1", "abcdefghijklmnop");
  writer.add_jpeg("/jpeg", {1'500'000'000, "odd"}, "bytes");
  writer.add_pose("/pose", {1'500'000'000, "world"},
                  Rigid3(Eigen::Quaterniond(0.8, 0.6, 0, 0), {1, 2, 3}));
  writer.finish();
  return testing::read_mcap(bytes);
}

// The fields of a message as its definition states them, by an interpreter of these.
class DefinedMessage {
 public:
  DefinedMessage(const testing::McapRecording& recording, const std::string& topic)
      : data_(recording.of_topic(topic).at(0).data) {
    const auto& channel = recording.channel(topic);
    EXPECT_EQ(channel.encoding, "cdr");
    const auto& schema = recording.schemas.at(channel.schema);
    EXPECT_EQ(schema.encoding, "ros2msg");
    std::istringstream lines(schema.data);
    std::string type;
    for (std::string line; std::getline(lines, line);) {
      if (line == std::string(80, '=')) {
        std::getline(lines, line);
        EXPECT_THAT(line, ::testing::StartsWith("MSG: "));
        type = line.substr(5);
      } else {
        types_[type].push_back({line.substr(0, line.find(' ')), line.substr(line.find(' ') + 1)});
      }
    }
    EXPECT_EQ(data_.substr(0, 4), std::string("\0\1\0\0", 4));
    at_ = 4;
    read("", "");
    EXPECT_EQ(at_, data_.size());
  }

  double number(const std::string& field) const { return numbers_.at(field); }
  const std::string& text(const std::string& field) const { return texts_.at(field); }

 private:
  struct Field {
    std::string type;
    std::string name;
  };

  void read(const std::string& type, const std::string& within) {
    for (const Field& field : types_.at(type)) {
      const std::size_t bracket = field.type.find('[');
      const std::string element = field.type.substr(0, bracket);
      const std::string name = within + field.name;
      if (bracket == std::string::npos) {
        read_value(element, name);
        continue;
      }
      const std::string size = field.type.substr(bracket + 1);
      const auto count = size == "]" ? static_cast<std::size_t>(take<std::uint32_t>())
                                     : static_cast<std::size_t>(std::stoi(size));
      for (std::size_t i = 0; i < count; ++i) read_value(element, name + std::to_string(i));
      numbers_[name] = static_cast<double>(count);
    }
  }
  void read_value(const std::string& type, const std::string& name) {
    if (type == "uint8" || type == "bool") {
      numbers_[name] = take<std::uint8_t>();
    } else if (type == "uint32" || type == "int32") {
      numbers_[name] = take<std::uint32_t>();
    } else if (type == "float64") {
      numbers_[name] = take<double>();
    } else if (type == "string") {
      const auto size = take<std::uint32_t>();
      texts_[name] = data_.substr(at_, size - 1);
      at_ += size;
    } else {
      read(type, name + ".");
    }
  }
  template <class Number>
  Number take() {
    at_ += (sizeof(Number) - (at_ - 4) % sizeof(Number)) % sizeof(Number);
    Number value;
    std::memcpy(&value, data_.data() + at_, sizeof value);
    at_ += sizeof value;
    return value;
  }

  std::string data_;
  std::size_t at_ = 0;
  std::map<std::string, std::vector<Field>> types_;
  std::map<std::string, double> numbers_;
  std::map<std::string, std::string> texts_;
};

TEST(Ros2Recording, MessagesAreAsTheirDefinitionsSay) {
  const testing::McapRecording recording = some_recording();
  const DefinedMessage info(recording, "/info");
  EXPECT_EQ(info.number("header.stamp.sec"), 1);
  EXPECT_EQ(info.number("header.stamp.nanosec"), 500'000'000);
  EXPECT_EQ(info.text("header.frame_id"), "odd");
  EXPECT_EQ(info.number("height"), 2);
  EXPECT_EQ(info.number("width"), 4);
  EXPECT_EQ(info.text("distortion_model"), "plumb_bob");
  EXPECT_EQ(info.number("d"), 5);
  EXPECT_EQ(info.number("d1"), -0.2);
  EXPECT_EQ(info.number("k4"), 510);
  EXPECT_EQ(info.number("r8"), 1);
  EXPECT_EQ(info.number("p3"), -100) << "-fx baseline";
  const DefinedMessage depth(recording, "/depth");
  EXPECT_EQ(depth.text("encoding"), "16UC1");
  EXPECT_EQ(depth.number("step"), 8);
  EXPECT_EQ(depth.number("data"), 16);
  EXPECT_EQ(depth.number("data15"), 'p');
  const DefinedMessage jpeg(recording, "/jpeg");
  EXPECT_EQ(jpeg.text("format"), "jpeg");
  EXPECT_EQ(jpeg.number("data0"), 'b');
  const DefinedMessage pose(recording, "/pose");
  EXPECT_EQ(pose.text("header.frame_id"), "world");
  EXPECT_EQ(pose.number("pose.position.z"), 3);
  EXPECT_DOUBLE_EQ(pose.number("pose.orientation.w"), 0.8);
  EXPECT_DOUBLE_EQ(pose.number("pose.orientation.x"), 0.6);
}

TEST(Ros2Recording, ACameraIsAsItWas) {
  for (Camera camera :
       {kCamera, Camera{CameraId{0}, "PINHOLE", 4, 2, {500, 510, 2, 1}},
        Camera{CameraId{0}, "OPENCV_FISHEYE", 4, 2, {500, 510, 2, 1, 0, 0, 0, 0}},
        Camera{CameraId{0}, "FULL_OPENCV", 4, 2, {500, 510, 2, 1, 1, 2, 3, 4, 5, 6, 7, 8}}}) {
    EXPECT_EQ(camera_of(ros_calibration(camera), false, "m"), camera);
  }
  EXPECT_THAT(
      testing::message_of(ErrorKind::kMisuse,
                          [] {
                            ros_calibration({CameraId{0}, "SIMPLE_PINHOLE", 4, 2, {500, 2, 1}});
                          }),
      HasSubstr("'SIMPLE_PINHOLE' in a recording of ROS"));
}

}  // namespace
}  // namespace cairn
