// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/recording/recording.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/core/error.hpp"
#include "cairn/core/file.hpp"
#include "cairn/recording/topics.hpp"

#include "support/recordings.hpp"
#include "support/refusal.hpp"
#include "support/temporary_folder.hpp"

namespace cairn {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using testing::WrittenMessages;

// Ten messages of two topics, in chunks of three: the second topic begins in the third chunk.
WrittenMessages some_messages() {
  WrittenMessages messages;
  for (std::uint64_t i = 0; i < 10; ++i) {
    const bool is_late = i >= 7 && i % 2 == 1;
    messages.push_back({is_late ? "/late" : "/early", is_late ? "std_msgs/String" : "a_msgs/B",
                        1'000'000'000 * i, "message " + std::to_string(i) + std::string(i, '.')});
  }
  return messages;
}

std::vector<std::string> contents_of(const Recording& recording) {
  std::vector<std::string> contents;
  for (const RecordedMessage& message : recording.messages()) {
    contents.push_back(recording.topics()[message.topic].name + " " + recording.read(message));
  }
  return contents;
}

std::vector<std::string> contents_of(const WrittenMessages& messages) {
  std::vector<std::string> contents;
  for (const auto& message : messages) contents.push_back(message.topic + " " + message.bytes);
  return contents;
}

struct RecordingTest : ::testing::Test {
  testing::TemporaryFolder folder;
  testing::Remarks remarks;
  const WrittenMessages written = some_messages();

  Recording open(const std::string& name, const std::string& bytes) {
    return Recording(folder.write(name, bytes), remarks.sink());
  }
};

TEST_F(RecordingTest, EveryContainerHoldsTheSameMessages) {
  const auto files =
      testing::write_all_containers(folder.path(), [&](const std::string&) { return written; });
  ASSERT_EQ(files.size(), 10U);
  for (const auto& file : files) {
    ASSERT_TRUE(Recording::is_at(file)) << file;
    const Recording recording(file, remarks.sink());
    EXPECT_EQ(contents_of(recording), contents_of(written)) << file;
    EXPECT_EQ(recording.messages()[3].time_ns, 3'000'000'000U) << file;
    EXPECT_EQ(recording.topics()[0].type, "a_msgs/B") << file;
    EXPECT_EQ(recording.read(recording.messages()[8], 4), "mess") << file;
  }
  EXPECT_THAT(remarks.texts, IsEmpty());
}

TEST_F(RecordingTest, MessagesAreSortedByTime) {
  WrittenMessages shuffled = written;
  std::swap(shuffled[0], shuffled[8]);
  std::swap(shuffled[2], shuffled[5]);
  EXPECT_EQ(contents_of(open("a.mcap", testing::mcap_bytes(shuffled))), contents_of(written));
  EXPECT_EQ(contents_of(open("a.bag", testing::rosbag_bytes(shuffled))), contents_of(written));
}

TEST_F(RecordingTest, AFolderIsOneRecording) {
  folder.write("a_0.mcap", testing::mcap_bytes({written.begin(), written.begin() + 4}));
  folder.write("a_1.mcap", testing::mcap_bytes({written.begin() + 4, written.end()}));
  EXPECT_TRUE(Recording::is_at(folder.path())) << "as a recorder leaves it that was killed";
  folder.write("notes.txt", "");
  EXPECT_FALSE(Recording::is_at(folder.path()));
  folder.write("metadata.yaml", "rosbag2_bagfile_information:\n");
  ASSERT_TRUE(Recording::is_at(folder.path()));
  const Recording recording(folder.path());
  EXPECT_EQ(contents_of(recording), contents_of(written));
  EXPECT_EQ(recording.topics().size(), 2U);
}

// Whatever is cut off, what was whole before the cut is read, and the damage is named.
TEST_F(RecordingTest, ATruncatedFileIsReadUpToTheDamage) {
  const std::vector<std::string> all = contents_of(written);
  for (const bool is_indexed : {true, false}) {
    const std::pair<std::string, std::string> files[] = {
        {"a.mcap", testing::mcap_bytes(written, {"", is_indexed})},
        {"a.bag", testing::rosbag_bytes(written, {"lz4", is_indexed})}};
    for (const auto& [name, bytes] : files) {
      std::size_t most = 0;
      for (std::size_t size = 20; size < bytes.size(); size += 7) {
        remarks.texts.clear();
        std::vector<std::string> contents;
        try {
          contents = contents_of(open(name, bytes.substr(0, size)));
        } catch (const Error& error) {
          EXPECT_THAT(error.what(), HasSubstr("holds no messages"));
        }
        ASSERT_LE(contents.size(), all.size());
        EXPECT_TRUE(std::equal(contents.begin(), contents.end(), all.begin())) << name << size;
        EXPECT_GE(contents.size(), most);
        most = contents.size();
        const bool lacks_only_the_end = contents.size() == all.size();
        if (!lacks_only_the_end) {
          EXPECT_THAT(remarks.texts, ElementsAre(HasSubstr(name + ": byte "))) << size;
        }
      }
      EXPECT_EQ(most, all.size());
    }
  }
}

TEST_F(RecordingTest, AMissingEndIsALoss) {
  EXPECT_EQ(contents_of(open("a.mcap", testing::mcap_bytes(written, {"lz4", true, false}))).size(),
            10U);
  EXPECT_THAT(remarks.texts, ElementsAre(HasSubstr("the end of the recording is missing; the 10")));
}

TEST_F(RecordingTest, AnEmptyBagIsWhole) {
  const auto empty = [](std::uint64_t index) {
    const std::string position = testing::little_endian(index);
    return "#ROSBAG V2.0\n" +
           testing::detail::bag_record({{"op", "\3"}, {"index_pos", position}}, "padding");
  };
  const std::uint64_t size = empty(0).size();
  const auto refused = [&](std::uint64_t index) {
    return testing::message_of(ErrorKind::kInput, [&] { open("a.bag", empty(index)); });
  };
  EXPECT_THAT(refused(size), HasSubstr("holds no messages"));
  EXPECT_THAT(remarks.texts, IsEmpty());
  EXPECT_THAT(refused(0), HasSubstr("holds no messages"));
  EXPECT_THAT(remarks.texts, ElementsAre(HasSubstr("the end of the recording is missing")));
}

// The other chunks are read.
TEST_F(RecordingTest, ADamagedChunkIsNamed) {
  for (const bool is_indexed : {true, false}) {
    std::string bytes = testing::mcap_bytes(written, {"zstd", is_indexed});
    bytes[bytes.find("zstd", bytes.find("zstd") + 1) + 20] ^= '\x55';
    remarks.texts.clear();
    const Recording recording = open("a.mcap", bytes);
    if (is_indexed) {
      EXPECT_THAT(remarks.texts, IsEmpty());
      EXPECT_EQ(recording.read(recording.messages()[9]), written[9].bytes);
      EXPECT_THAT(
          testing::message_of(ErrorKind::kInput, [&] { recording.read(recording.messages()[4]); }),
          HasSubstr("damaged zstd data"));
    } else {
      EXPECT_THAT(remarks.texts, ElementsAre(HasSubstr("a.mcap: byte ")));
      EXPECT_THAT(remarks.texts[0], HasSubstr("damaged zstd data"));
      std::vector<std::string> rest = contents_of(written);
      rest.erase(rest.begin() + 3, rest.begin() + 6);
      EXPECT_EQ(contents_of(recording), rest);
    }
  }
}

TEST_F(RecordingTest, APackedChunkMatchesItsChecksum) {
  using Checksum = testing::ContainerOptions::Checksum;
  const auto bytes = [&](Checksum checksum) {
    return testing::mcap_bytes(written, {.compression = "lz4", .checksum = checksum});
  };
  EXPECT_EQ(contents_of(open("a.mcap", bytes(Checksum::kRight))), contents_of(written));
  EXPECT_THAT(
      testing::message_of(ErrorKind::kInput, [&] { open("b.mcap", bytes(Checksum::kWrong)); }),
      HasSubstr("holds no messages"));
  EXPECT_THAT(remarks.texts,
              ::testing::Each(HasSubstr("a chunk that does not match its checksum")));
}

TEST_F(RecordingTest, LengthsAreNotTrusted) {
  const std::string bytes = testing::mcap_bytes(written, {"lz4"});
  const std::size_t name = bytes.find("lz4");
  std::string huge = bytes;
  huge.replace(name - 4 - 4 - 8, 8, std::string(7, '\x7f') + '\0');
  EXPECT_THAT(testing::message_of(ErrorKind::kInput, [&] { open("a.mcap", huge); }),
              HasSubstr("holds no messages"));
  EXPECT_THAT(remarks.texts.at(0), HasSubstr("expected at most"));
  huge = bytes;
  huge.replace(9, 8, std::string(8, '\xff'));
  EXPECT_THAT(testing::message_of(ErrorKind::kInput, [&] { open("a.mcap", huge); }),
              HasSubstr("holds no messages"));
  EXPECT_THAT(remarks.texts.back(), HasSubstr("a record longer than what is left"));
}

TEST_F(RecordingTest, OtherFilesAreNoRecordings) {
  EXPECT_FALSE(Recording::is_at(folder.write("a.db3", "SQL")));
  EXPECT_FALSE(Recording::is_at(folder / "absent.bag"));
  EXPECT_FALSE(Recording::is_at(folder.write("a.bag", "#ROSBAG V1.2\n")));
  EXPECT_THAT(testing::message_of(ErrorKind::kInput, [&] { Recording(folder / "a.bag"); }),
              HasSubstr("a.bag: is no recording"));
  sqlite::Database(folder / "other.db3", {.access = sqlite::Access::kCreate})
      .execute("CREATE TABLE words(word TEXT)");
  EXPECT_THAT(testing::message_of(ErrorKind::kInput, [&] { Recording(folder / "other.db3"); }),
              HasSubstr("no tables topics and messages"));
}

// ---- Topics of cameras

struct SensorTopicsTest : RecordingTest {
  WrittenMessages messages;

  void image(const std::string& topic, const std::string& encoding,
             const std::string& frame = "f") {
    ImageMessage message;
    message.header.frame = frame;
    message.is_compressed = topic.find("ompressed") != std::string::npos;
    message.encoding = encoding;
    messages.push_back({topic,
                        message.is_compressed ? "sensor_msgs/CompressedImage" : "sensor_msgs/Image",
                        messages.size(), testing::image_bytes("cdr", 0, message)});
  }
  void info(const std::string& topic, double translation, const std::string& frame = "f") {
    CameraInfo camera;
    camera.header.frame = frame;
    camera.projection[0] = 100;
    camera.projection[3] = translation;
    messages.push_back({topic, "sensor_msgs/CameraInfo", messages.size(),
                        testing::camera_info_bytes("cdr", camera)});
  }
  std::string chosen(const std::string& given = {}) {
    const Recording recording = open("a.mcap", testing::mcap_bytes(messages));
    const SensorTopics topics = choose_topics(recording, image_topics(recording), given);
    return recording.topics()[topics.image.topic].name + " " +
           recording.topics()[topics.depth_or_right.topic].name +
           (topics.is_stereo() ? " stereo" : "");
  }
  std::string refused(const std::string& given = {}) {
    return testing::message_of(ErrorKind::kInput, [&] { chosen(given); });
  }
};

TEST_F(SensorTopicsTest, ColourAndDepthAreChosenByTheirPixels) {
  image("/b/image", "16UC1");
  image("/a/image", "rgb8");
  EXPECT_EQ(chosen(), "/a/image /b/image");
}

TEST_F(SensorTopicsTest, ACompressedCopyIsNoChoice) {
  image("/depth/image/compressedDepth", "16UC1; compressedDepth png");
  image("/color/image/compressed", "jpeg");
  EXPECT_EQ(chosen(), "/color/image/compressed /depth/image/compressedDepth");
  image("/color/image", "rgb8");
  EXPECT_EQ(chosen(), "/color/image /depth/image/compressedDepth");
}

TEST_F(SensorTopicsTest, TheRightCameraIsTheOneWithATranslation) {
  image("/a/image", "mono8");
  image("/b/image", "mono8");
  info("/a/camera_info", -20);
  info("/b/camera_info", 0);
  EXPECT_EQ(chosen(), "/b/image /a/image stereo");
  const Recording recording = open("a.mcap", testing::mcap_bytes(messages));
  const auto pose =
      image_from_partner(recording, choose_topics(recording, image_topics(recording)));
  ASSERT_TRUE(pose);
  EXPECT_LT((pose->translation() - Eigen::Vector3d(0.2, 0, 0)).norm(), 1e-15);
}

TEST_F(SensorTopicsTest, WithoutATranslationTheStaticTransformsSayIt) {
  image("/a/image", "mono8", "left_optical");
  image("/b/image", "mono8", "right_optical");
  info("/a/camera_info", 0, "left_optical");
  info("/b/camera_info", 0, "right_optical");
  const auto pose_of_right = [&] {
    const Recording recording = open("a.mcap", testing::mcap_bytes(messages));
    return image_from_partner(recording, choose_topics(recording, image_topics(recording)));
  };
  EXPECT_FALSE(pose_of_right());
  testing::MessageFields fields("cdr");
  fields.number(std::uint32_t{2});
  for (const auto& [child, y] : {std::pair{"left_optical", 0.05}, {"right_optical", -0.05}}) {
    // The body looks along x, with y to the left: an optical frame turns by -90 degrees about z after x.
    fields.header(0, "body").text(child).doubles(std::array{1.0, y, 2.0});
    fields.doubles(std::array{-0.5, 0.5, -0.5, 0.5});
  }
  messages.push_back({"/tf_static", "tf2_msgs/TFMessage", 99, fields.bytes()});
  ASSERT_TRUE(pose_of_right());
  EXPECT_LT((pose_of_right()->translation() - Eigen::Vector3d(0.1, 0, 0)).norm(), 1e-12);
}

TEST_F(SensorTopicsTest, SeveralCamerasAreListed) {
  image("/a/image", "rgb8");
  EXPECT_THAT(refused(),
              HasSubstr("1 topics of images, 0 of depth: /a/image; expected one of each"));
  image("/b/image", "rgb8");
  image("/c/image", "32FC1");
  EXPECT_THAT(refused(),
              HasSubstr("2 topics of images, 1 of depth: /a/image, /b/image, /c/image (depth)"));
  EXPECT_EQ(chosen("/b/image,/c/image"), "/b/image /c/image");
  EXPECT_EQ(chosen("/b/image,/a/image"), "/b/image /a/image stereo");
  EXPECT_THAT(refused("/b/image,/d/image"), HasSubstr("has no images '/d/image'"));
  EXPECT_THAT(refused("/c/image,/a/image"), HasSubstr("/c/image are depth images"));
}

}  // namespace
}  // namespace cairn
