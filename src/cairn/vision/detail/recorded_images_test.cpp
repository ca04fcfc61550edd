// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/vision/detail/recorded_images.hpp"

#include <algorithm>
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/core/error.hpp"
#include "cairn/vision/detail/depth_registration.hpp"
#include "cairn/vision/sequence.hpp"

#include "support/recorded_sequence.hpp"
#include "support/refusal.hpp"
#include "support/temporary_folder.hpp"

namespace cairn {
namespace {

using ::testing::HasSubstr;
using testing::Recorded;
using testing::WrittenMessages;

const Camera kCamera{CameraId{0}, "PINHOLE", 32, 24, {50, 50, 16, 12}};

template <class ImageOf>
ImageOf noise(std::uint32_t seed) {
  std::mt19937 random(seed);
  ImageOf image(32, 24);
  for (auto& value : image.values) value = static_cast<std::uint8_t>(random());
  return image;
}

void write_sequence(const std::filesystem::path& folder, bool is_stereo) {
  std::optional<SequenceWriter> writer;
  if (is_stereo) {
    writer.emplace(
        folder,
        StereoRig{kCamera, kCamera, Rigid3(Eigen::Quaterniond::Identity(), {0.125, 0.0, 0.0})},
        ColorFormat::kPng);
  } else {
    writer.emplace(folder, ColorFormat::kPng);
  }
  for (std::uint32_t i = 0; i < 4; ++i) {
    const double time_s = 1305031453.359684 + 0.1 * i;
    const auto first = noise<ColorImage>(i);
    if (is_stereo) {
      writer->add(time_s, first, noise<ColorImage>(100 + i));
    } else {
      auto depth = noise<DepthImage>(200 + i);
      for (float& metres : depth.values) metres /= 64.0F;
      writer->add(time_s, first, depth);
    }
  }
  writer->finish();
}

void expect_same(const ImageSequence& recording, const ImageSequence& folder) {
  ASSERT_EQ(recording.frames().size(), folder.frames().size());
  EXPECT_EQ(recording.baseline_m(), folder.baseline_m());
  for (std::size_t i = 0; i < folder.frames().size(); ++i) {
    EXPECT_EQ(recording.frames()[i].timestamp_s, folder.frames()[i].timestamp_s);
    const ImageSequence::Images got = recording.read(i);
    const ImageSequence::Images expected = folder.read(i);
    EXPECT_EQ(got.gray, expected.gray);
    EXPECT_EQ(got.depth, expected.depth);
    EXPECT_EQ(got.right, expected.right);
    EXPECT_EQ(recording.read_color(i), folder.read_color(i));
  }
}

struct RecordedImagesTest : ::testing::Test {
  testing::TemporaryFolder folder;
  testing::Remarks remarks;

  ImageSequence sequence(bool is_stereo = false) {
    write_sequence(folder / "sequence", is_stereo);
    return ImageSequence(folder / "sequence");
  }
  ImageSequence open(const WrittenMessages& messages, const SequenceOptions& options = {}) {
    return ImageSequence(folder.write("a.mcap", testing::mcap_bytes(messages)), options,
                         remarks.sink());
  }
  std::string refused(const WrittenMessages& messages) {
    return testing::message_of(ErrorKind::kInput, [&] { open(messages).read(0); });
  }
};

TEST_F(RecordedImagesTest, EveryContainerHasTheImagesOfTheFolder) {
  for (const bool is_stereo : {false, true}) {
    std::filesystem::remove_all(folder / "sequence");
    const ImageSequence original = sequence(is_stereo);
    const auto files =
        testing::write_all_containers(folder.path(), [&](const std::string& encoding) {
          return testing::recorded(original, kCamera, encoding);
        });
    for (const auto& file : files) {
      SCOPED_TRACE(file);
      const ImageSequence recording(file);
      EXPECT_EQ(recording.camera(std::nullopt), kCamera);
      expect_same(recording, original);
      std::filesystem::remove(file);
    }
  }
}

TEST_F(RecordedImagesTest, CompressedImagesAreThoseOfTheFolder) {
  const ImageSequence original = sequence();
  const WrittenMessages messages =
      testing::recorded(original, kCamera, "cdr", Recorded::kCompressed);
  expect_same(open(messages, {.depth_units_per_metre = kTumDepthUnits}), original);
  EXPECT_EQ(open(messages).depth_units_per_metre(), 1000.0) << "as ROS has it";
}

TEST_F(RecordedImagesTest, TheOrderOfMessagesDoesNotMatter) {
  const ImageSequence original = sequence();
  WrittenMessages messages = testing::recorded(original, kCamera, "cdr");
  std::shuffle(messages.begin(), messages.end(), std::mt19937(1));
  for (std::size_t i = 0; i < messages.size(); ++i) messages[i].time_ns = i;
  expect_same(open(messages), original);
}

TEST_F(RecordedImagesTest, ARepeatedTimeIsLeftOut) {
  const ImageSequence original = sequence();
  WrittenMessages messages = testing::recorded(original, kCamera, "cdr");
  messages.push_back(messages[4]);
  expect_same(open(messages), original);
  EXPECT_THAT(remarks.texts,
              ::testing::ElementsAre(HasSubstr("1 of 5 images have the time of another")));
}

// One image of each encoding, of one colour or depth.
TEST_F(RecordedImagesTest, ReadsEveryEncodingOfPixels) {
  const auto messages_with = [&](const std::string& encoding, const std::string& pixel,
                                 const std::string& depth_encoding, const std::string& depth,
                                 bool is_big_endian) {
    WrittenMessages messages;
    const auto add = [&](const std::string& topic, const std::string& its,
                         const std::string& value) {
      ImageMessage image;
      image.width = 32;
      image.height = 24;
      image.encoding = its;
      image.is_big_endian = is_big_endian;
      image.row_bytes = static_cast<std::uint32_t>(32 * value.size());
      std::string data;
      for (int i = 0; i < 32 * 24; ++i) data += value;
      image.data = data;
      messages.push_back({topic, "sensor_msgs/Image", 0, testing::image_bytes("cdr", 0, image)});
    };
    add("/image", encoding, pixel);
    add("/depth", depth_encoding, depth);
    return messages;
  };
  const auto bgr_of = [&](const std::string& encoding, const std::string& pixel,
                          bool is_big_endian) {
    const ColorImage image =
        open(messages_with(encoding, pixel, "16UC1", std::string(2, '\0'), is_big_endian))
            .read_color(0);
    return std::vector<int>(image.values.end() - 3, image.values.end());
  };
  const std::vector<int> colour = {10, 20, 30};
  EXPECT_EQ(bgr_of("bgr8", "\x0a\x14\x1e", false), colour);
  EXPECT_EQ(bgr_of("rgb8", "\x1e\x14\x0a", false), colour);
  EXPECT_EQ(bgr_of("bgra8", "\x0a\x14\x1e\x01", false), colour);
  EXPECT_EQ(bgr_of("rgba8", "\x1e\x14\x0a\x01", true), colour);
  EXPECT_EQ(bgr_of("mono8", "\x14", false), std::vector<int>(3, 20));
  EXPECT_EQ(bgr_of("mono16", "\x01\x14", false), std::vector<int>(3, 20));
  EXPECT_EQ(bgr_of("mono16", "\x14\x01", true), std::vector<int>(3, 20));
  const auto metres_of = [&](const std::string& encoding, const std::string& depth,
                             bool is_big_endian) {
    return open(messages_with("mono8", "a", encoding, depth, is_big_endian))
        .read(0)
        .depth.values.back();
  };
  EXPECT_FLOAT_EQ(metres_of("16UC1", "\xdc\x05", false), 1.5F);
  EXPECT_FLOAT_EQ(metres_of("mono16", "\x05\xdc", true), 1.5F);
  EXPECT_FLOAT_EQ(metres_of("32FC1", std::string("\0\0\xc0\x3f", 4), false), 1.5F);
  EXPECT_FLOAT_EQ(metres_of("32FC1", std::string("\x3f\xc0\0\0", 4), true), 1.5F);
  EXPECT_EQ(metres_of("32FC1", std::string("\0\0\xc0\x7f", 4), false), 0.0F) << "NaN";
  EXPECT_THAT(
      refused(messages_with("bayer_rggb8", "a", "16UC1", "ab", false)),
      HasSubstr("a.mcap/image/0.000000.png: an image encoded as 'bayer_rggb8'; expected mono8"));
}

TEST_F(RecordedImagesTest, ReadsInverseDepth) {
  WrittenMessages messages = testing::recorded(sequence(), kCamera, "cdr", Recorded::kCompressed);
  write_png(folder / "d.png", StoredDepthImage(32, 24, 100));
  const std::string png = read_file(folder / "d.png");
  ImageMessage image;
  image.is_compressed = true;
  image.encoding = "32FC1; compressedDepth png";
  const float head[] = {0.0F, 180.0F, 10.0F};
  const std::string data = std::string(reinterpret_cast<const char*>(head), 12) + png;
  image.data = data;
  std::erase_if(messages, [](const auto& message) { return message.topic.ends_with("Depth"); });
  messages.push_back({"/cam/depth/image/compressedDepth", "sensor_msgs/CompressedImage", 0,
                      testing::image_bytes("cdr", 1'305'031'453'359'684'000, image)});
  EXPECT_FLOAT_EQ(open(messages).read(0).depth.at(3, 3), 2.0F) << "180 / (100 - 10)";
}

TEST_F(RecordedImagesTest, NamesWhatIsMissingOrWrong) {
  const ImageSequence original = sequence();
  WrittenMessages messages = testing::recorded(original, kCamera, "cdr");
  const auto without = [&](const std::string& topic) {
    WrittenMessages rest = messages;
    std::erase_if(rest, [&](const auto& message) { return message.topic == topic; });
    return rest;
  };
  EXPECT_THAT(
      testing::message_of(ErrorKind::kInput,
                          [&] { open(without("/cam/left/camera_info")).camera(std::nullopt); }),
      HasSubstr("CameraInfo of /cam/left/image: is missing; expected one, or the camera"));
  EXPECT_EQ(open(without("/cam/left/camera_info")).camera(kCamera), kCamera);
  EXPECT_THAT(refused(without("/cam/depth/image")), HasSubstr("1 topics of images, 0 of depth"));
  Camera other = kCamera;
  other.parameters[0] = 60;
  messages[1].bytes = testing::camera_info_bytes("cdr", testing::camera_info(other, "d"));
  EXPECT_THAT(refused(messages), HasSubstr("another camera than that of the images"));
  EXPECT_THAT(testing::message_of(ErrorKind::kMisuse,
                                  [&] { ImageSequence(folder / "sequence", {.topics = "/a,/b"}); }),
              HasSubstr("topics: given, but"));
}

TEST_F(RecordedImagesTest, DepthOfAnotherCameraIsRegistered) {
  WrittenMessages messages = testing::recorded(sequence(), kCamera, "cdr");
  Camera wide = kCamera;
  wide.parameters[0] = wide.parameters[1] = 40;
  messages[1].bytes = testing::camera_info_bytes("cdr", testing::camera_info(wide, "d"));
  testing::MessageFields fields("cdr");
  fields.number(std::uint32_t{1}).header(0, "/cam/left/image").text("/cam/depth/image");
  fields.doubles(std::array{0.05, 0.0, 0.0}).doubles(std::array{0.0, 0.0, 0.0, 1.0});
  messages.push_back({"/tf_static", "tf2_msgs/TFMessage", 99, fields.bytes()});
  const ImageSequence recording = open(messages);
  const ImageSequence original(folder / "sequence");
  const detail::DepthRegistration expected(
      wide, kCamera, Rigid3(Eigen::Quaterniond::Identity(), {0.05, 0.0, 0.0}));
  for (std::size_t i = 0; i < original.frames().size(); ++i) {
    EXPECT_EQ(recording.read(i).depth, expected(original.read(i).depth));
  }
  // A nominal CameraInfo of both cameras does not put one where the other is.
  messages[1].bytes = testing::camera_info_bytes("cdr", testing::camera_info(kCamera, "d"));
  const detail::DepthRegistration beside(kCamera, kCamera,
                                         Rigid3(Eigen::Quaterniond::Identity(), {0.05, 0.0, 0.0}));
  EXPECT_EQ(open(messages).read(0).depth, beside(original.read(0).depth));
  WrittenMessages alone = messages;
  alone.pop_back();
  EXPECT_EQ(open(alone).read(0).depth, original.read(0).depth);
  wide.width = 31;
  messages[1].bytes = testing::camera_info_bytes("cdr", testing::camera_info(wide, "d"));
  EXPECT_THAT(refused(messages),
              HasSubstr("32 x 24 pixels; expected 31 x 24, as its CameraInfo says"));
}

TEST_F(RecordedImagesTest, ASwappedPairIsRefused) {
  const WrittenMessages messages = testing::recorded(sequence(true), kCamera, "cdr");
  EXPECT_THAT(
      testing::message_of(ErrorKind::kInput,
                          [&] { open(messages, {.topics = "/cam/right/image,/cam/left/image"}); }),
      HasSubstr("left and right are swapped"));
}

}  // namespace
}  // namespace cairn
