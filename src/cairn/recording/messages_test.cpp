// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/recording/messages.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/core/error.hpp"

#include "support/recordings.hpp"
#include "support/refusal.hpp"

namespace cairn {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using testing::MessageFields;

// As MessageBytes names an encoding.
std::string_view stated(const std::string& encoding) {
  return encoding == "ros1" ? "ros1" : "cdr";
}

CameraInfo some_info() {
  CameraInfo info;
  info.header.frame = "odd";  // so that what follows is not aligned by itself
  info.width = 640;
  info.height = 480;
  info.distortion_model = "plumb_bob";
  info.distortion = {0.1, -0.2, 0.001, 0.002, 0.0};
  info.intrinsics = {500, 0, 320, 0, 510, 240, 0, 0, 1};
  info.projection = {505, 0, 321, -50.5, 0, 505, 241, 0, 0, 0, 1, 0};
  return info;
}

class MessagesTest : public ::testing::TestWithParam<const char*> {};

TEST_P(MessagesTest, AnImageIsAsWritten) {
  ImageMessage image;
  image.header.frame = "optical";
  image.width = 3;
  image.height = 2;
  image.encoding = "mono8";
  image.row_bytes = 3;
  image.data = "abcdef";
  const std::string bytes = testing::image_bytes(GetParam(), 1'305'031'453'359'684'000, image);
  const MessageBytes message{bytes, stated(GetParam()), "m"};
  EXPECT_EQ(stamp_of(message), 1305031453.359684);
  const ImageMessage read = parse_image(message, "sensor_msgs/Image");
  EXPECT_EQ(read.header.stamp_s, 1305031453.359684);
  EXPECT_EQ(read.header.frame, "optical");
  EXPECT_EQ(read.width, 3U);
  EXPECT_EQ(read.height, 2U);
  EXPECT_EQ(read.encoding, "mono8");
  EXPECT_EQ(read.row_bytes, 3U);
  EXPECT_EQ(read.data, "abcdef");
}

TEST_P(MessagesTest, ACameraIsAsWritten) {
  const CameraInfo written = some_info();
  const std::string bytes = testing::camera_info_bytes(GetParam(), written);
  const CameraInfo read = parse_camera_info({bytes, stated(GetParam()), "m"});
  EXPECT_EQ(read.header.frame, "odd");
  EXPECT_EQ(read.distortion, written.distortion);
  EXPECT_EQ(read.intrinsics, written.intrinsics);
  EXPECT_EQ(read.rectification, written.rectification);
  EXPECT_EQ(read.projection, written.projection);
}

TEST_P(MessagesTest, TransformsAreAsWritten) {
  MessageFields fields(GetParam());
  fields.number(std::uint32_t{1}).header(5, "base").text("camera");
  fields.doubles(std::array{1.0, 2.0, 3.0}).doubles(std::array{0.0, 0.0, 0.6, 0.8});
  const auto read = parse_transforms({fields.bytes(), stated(GetParam()), "m"});
  ASSERT_EQ(read.size(), 1U);
  EXPECT_EQ(read[0].parent, "base");
  EXPECT_EQ(read[0].child, "camera");
  EXPECT_EQ(read[0].parent_from_child.translation(), Eigen::Vector3d(1, 2, 3));
  EXPECT_NEAR(read[0].parent_from_child.quaternion().w(), 0.8, 1e-15);
}

TEST_P(MessagesTest, EveryTruncationIsRefusedAndNamed) {
  const std::string info = testing::camera_info_bytes(GetParam(), some_info());
  constexpr std::size_t kBehind = 25;  // binning and region, which are not read
  for (std::size_t size = 0; size + kBehind < info.size(); ++size) {
    const std::string cut = info.substr(0, size);
    EXPECT_THAT(
        testing::message_of(ErrorKind::kInput,
                            [&] {
                              parse_camera_info({cut, stated(GetParam()), "recording: /info"});
                            }),
        HasSubstr("recording: /info"))
        << size;
  }
}

TEST_P(MessagesTest, ALengthIsNotTrusted) {
  MessageFields fields(GetParam());
  fields.header(0, "").text("jpeg").number(~std::uint32_t{0});
  EXPECT_THAT(
      testing::message_of(
          ErrorKind::kInput,
          [&] {
            parse_image({fields.bytes(), stated(GetParam()), "m"}, "sensor_msgs/CompressedImage");
          }),
      HasSubstr("data: the message ends"));
}

INSTANTIATE_TEST_SUITE_P(Encodings, MessagesTest, ::testing::Values("ros1", "cdr", "cdr-be"));

TEST(Messages, OtherEncodingsAreRefused) {
  EXPECT_THAT(testing::message_of(ErrorKind::kInput,
                                  [] {
                                    stamp_of({"12345678", "json", "m"});
                                  }),
              HasSubstr("encoded as 'json'; expected cdr or ros1"));
  const std::string parameters("\0\3\0\0\0\0\0\0\0\0\0\0", 12);
  EXPECT_THAT(testing::message_of(ErrorKind::kInput,
                                  [&] {
                                    stamp_of({parameters, "cdr", "m"});
                                  }),
              HasSubstr("expected plain CDR"));
}

}  // namespace
}  // namespace cairn
