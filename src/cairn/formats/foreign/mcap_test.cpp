// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/formats/foreign/mcap.hpp"

#include <cmath>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/formats/map_file.hpp"
#include "cairn/map/synthetic.hpp"

#include "support/imported_maps.hpp"
#include "support/maps.hpp"
#include "support/mcap_recording.hpp"

namespace cairn {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using testing::McapMessage;
using testing::McapRecording;
using testing::message_of;
using ::testing::Not;
using testing::protobuf_fields;
using testing::ProtobufField;

constexpr std::uint64_t kSecond = 1'000'000'000;

std::string mcap_of(const LandmarkMap& map) {
  std::string bytes;
  write_mcap(map, [&](std::string_view more) { bytes += more; });
  return bytes;
}

McapRecording recording_of(const LandmarkMap& map) {
  return testing::read_mcap(mcap_of(map));
}

Eigen::Vector3d vector_of(const ProtobufField& field) {
  auto fields = protobuf_fields(field.bytes);
  return {fields.at(1).at(0).real(), fields.at(2).at(0).real(), fields.at(3).at(0).real()};
}

// The columns of a point cloud by their names, as doubles.
struct Cloud {
  std::string frame;
  std::vector<std::string> names;
  std::map<std::string, std::vector<double>> columns;

  explicit Cloud(const McapMessage& message) {
    auto fields = protobuf_fields(message.data);
    frame = fields.at(2).at(0).bytes;
    const auto stride = fields.at(4).at(0).number;
    const std::string& data = fields.at(6).at(0).bytes;
    for (const ProtobufField& field : fields.at(5)) {
      auto of_field = protobuf_fields(field.bytes);
      const std::string name = of_field.at(1).at(0).bytes;
      const auto offset = of_field.at(2).at(0).number;
      names.push_back(name);
      for (std::size_t at = offset; at < data.size(); at += stride) {
        columns[name].push_back(value(data.substr(at), of_field.at(3).at(0).number));
      }
    }
  }

  // By the numbers of Foxglove's NumericType.
  static double value(const std::string& bytes, std::uint64_t type) {
    testing::McapBytes in(bytes);
    switch (type) {
      case 1:
        return in.number<std::uint8_t>();
      case 5:
        return in.number<std::uint32_t>();
      case 7:
        return in.number<float>();
      case 8:
        return in.number<double>();
      default:
        ADD_FAILURE() << "type " << type;
        return 0.0;
    }
  }
};

// The points of the only line of the only entity of a scene.
std::vector<Eigen::Vector3d> line_points(const McapMessage& scene) {
  const auto entity = protobuf_fields(protobuf_fields(scene.data).at(2).at(0).bytes);
  const auto line = protobuf_fields(entity.at(11).at(0).bytes);
  std::vector<Eigen::Vector3d> points;
  for (const ProtobufField& point : line.at(5)) {
    points.push_back(vector_of(point));
  }
  return points;
}

class McapTest : public testing::ImportTest {};

TEST_F(McapTest, LandmarksAreAPointCloud) {
  MapTables tables = testing::full_tables();
  tables.landmarks.ids[2] = LandmarkId{4294967295};
  tables.landmarks.colors[1] = Color{1, 2, 3};
  const LandmarkMap map(std::move(tables));
  const McapRecording recording = recording_of(map);
  const auto clouds = recording.of_topic("/landmarks");
  ASSERT_EQ(clouds.size(), 1U);
  EXPECT_EQ(clouds[0].schema, "foxglove.PointCloud");
  EXPECT_EQ(recording.channel("/landmarks").metadata.at("length_unit"), "free");
  const Cloud cloud(clouds[0]);
  EXPECT_EQ(cloud.frame, "world");
  EXPECT_THAT(cloud.names, ElementsAre("x", "y", "z", "cov_xx", "cov_xy", "cov_xz", "cov_yy",
                                       "cov_yz", "cov_zz", "red", "green", "blue", "alpha",
                                       "observations", "id", "confidence", "never_set"));
  ASSERT_EQ(cloud.columns.at("z").size(), 4U);
  for (std::size_t i = 0; i < 4; ++i) {
    const Eigen::Vector3f position = map.landmarks().positions[i].cast<float>();
    EXPECT_EQ(cloud.columns.at("x")[i], position.x());
    EXPECT_EQ(cloud.columns.at("y")[i], position.y());
    EXPECT_EQ(cloud.columns.at("z")[i], position.z());
  }
  EXPECT_THAT(cloud.columns.at("red"), ElementsAre(200, 1, 0, 255));
  EXPECT_THAT(cloud.columns.at("green"), ElementsAre(180, 2, 0, 255));
  EXPECT_THAT(cloud.columns.at("blue"), ElementsAre(40, 3, 0, 255));
  EXPECT_THAT(cloud.columns.at("alpha"), ElementsAre(255, 255, 255, 255));
  EXPECT_THAT(cloud.columns.at("observations"), ElementsAre(2, 1, 0, 2));
  EXPECT_THAT(cloud.columns.at("id"), ElementsAre(30, 10, 4294967295, 20));
  EXPECT_EQ(cloud.columns.at("cov_xz")[0], -3e-5);
  EXPECT_TRUE(std::isnan(cloud.columns.at("cov_xx")[1]));
  EXPECT_EQ(cloud.columns.at("confidence")[0], 0.25);
  EXPECT_TRUE(std::isnan(cloud.columns.at("confidence")[1]));
}

TEST_F(McapTest, PositionsFarFromTheOriginAreDouble) {
  MapTables tables = testing::plain_tables();
  for (Eigen::Vector3d& position : tables.landmarks.positions) {
    position += Eigen::Vector3d(500000.123, 5300000.456, 0.0);
  }
  const LandmarkMap map(std::move(tables));
  const Cloud cloud(recording_of(map).of_topic("/landmarks")[0]);
  for (std::size_t i = 0; i < map.landmark_count(); ++i) {
    EXPECT_EQ(cloud.columns.at("y")[i], map.landmarks().positions[i].y());
  }
}

TEST_F(McapTest, KeyframesArePosesAtTheirTimes) {
  MapTables tables = testing::full_tables();
  tables.frames.timestamps_s = {2.25, 1305031453.374112, 0.5};
  const LandmarkMap map(std::move(tables));
  const McapRecording recording = recording_of(map);
  const auto transforms = recording.of_topic("/tf");
  ASSERT_EQ(transforms.size(), 3U);
  EXPECT_EQ(transforms[0].time_ns, kSecond / 2);
  EXPECT_EQ(transforms[1].time_ns, 9 * kSecond / 4);
  // A double of this size knows its time to 2.4e-7 s.
  EXPECT_NEAR(static_cast<double>(transforms[2].time_ns - 1305031453 * kSecond), 374112000, 120);
  const std::uint32_t order[] = {2, 0, 1};
  const char* const cameras[] = {"camera/5", "camera/2", "camera"};
  for (std::size_t i = 0; i < 3; ++i) {
    auto fields = protobuf_fields(transforms[i].data);
    auto time = protobuf_fields(fields.at(1).at(0).bytes);
    EXPECT_EQ(time.at(1).at(0).number, transforms[i].time_ns / kSecond);
    EXPECT_EQ(time.at(2).at(0).number, transforms[i].time_ns % kSecond);
    EXPECT_EQ(fields.at(2).at(0).bytes, "world");
    EXPECT_EQ(fields.at(3).at(0).bytes, cameras[i]);
    const Rigid3 pose = map.world_from_camera(FrameIndex{order[i]});
    EXPECT_EQ(vector_of(fields.at(4).at(0)), pose.translation());
    const Eigen::Vector3d axis = vector_of(fields.at(5).at(0));
    const double w = protobuf_fields(fields.at(5).at(0).bytes).at(4).at(0).real();
    EXPECT_TRUE(
        Eigen::Quaterniond(w, axis.x(), axis.y(), axis.z()).isApprox(pose.quaternion(), 1e-15));
  }
  // What does not move is there from the start.
  for (const char* topic : {"/landmarks", "/keyframes", "/trajectory"}) {
    EXPECT_EQ(recording.of_topic(topic).at(0).time_ns, kSecond / 2) << topic;
  }
  const auto line = line_points(recording.of_topic("/trajectory").at(0));
  EXPECT_THAT(line, ElementsAre(map.frames().translations[2], map.frames().translations[0],
                                map.frames().translations[1]));
}

TEST_F(McapTest, AMapWithoutTimesHasAKeyframeEachTenthOfASecond) {
  const McapRecording recording = recording_of(testing::plain_map());
  const auto transforms = recording.of_topic("/tf");
  ASSERT_EQ(transforms.size(), 2U);
  EXPECT_EQ(transforms[0].time_ns, 0U);
  EXPECT_EQ(transforms[1].time_ns, kSecond / 10);
  EXPECT_THAT(recording.channel("/tf").metadata.at("times"), HasSubstr("made up, 0.1 s apart"));
  EXPECT_EQ(protobuf_fields(transforms[0].data).at(3).at(0).bytes, "camera");
  MapTables tables = testing::plain_tables();
  tables.frames.timestamps_s = {1.0, 2.0};
  EXPECT_THAT(recording_of(LandmarkMap(tables)).channel("/tf").metadata, IsEmpty());
}

TEST_F(McapTest, FrustaEncloseWhatTheCamerasSee) {
  MapTables tables = testing::plain_tables();
  tables.cameras = {{CameraId{1}, "PINHOLE", 640, 480, {500, 400, 300, 200}}};
  tables.frames.cameras = {CameraIndex{0}, std::nullopt};
  const LandmarkMap map(std::move(tables));
  const auto points = line_points(recording_of(map).of_topic("/keyframes").at(0));
  ASSERT_EQ(points.size(), 7U) << "five of a frustum, two of a keyframe without a camera";
  EXPECT_EQ(points[0], map.frames().translations[0]);
  const Camera& camera = map.cameras()[0];
  const Pixel top_left = project(camera, points[1]).value();
  const Pixel bottom_right = project(camera, points[3]).value();
  EXPECT_NEAR(top_left.u, -0.5, 1e-9);
  EXPECT_NEAR(top_left.v, -0.5, 1e-9);
  EXPECT_NEAR(bottom_right.u, 639.5, 1e-9);
  EXPECT_NEAR(bottom_right.v, 479.5, 1e-9);
  EXPECT_EQ(points[5], map.frames().translations[1]);
  EXPECT_EQ((points[6] - points[5]).normalized(), Eigen::Vector3d::UnitZ());
}

TEST_F(McapTest, ALargeMapIsSeveralChunks) {
  MapTables tables = std::move(synthetic_map({.seed = 1, .landmarks = 50, .frames = 20})).tables();
  tables.observations = {};
  tables.frames = {};
  constexpr std::uint32_t kFrames = 12000;
  for (std::uint32_t i = 0; i < kFrames; ++i) {
    tables.frames.ids.push_back(FrameId{i});
    tables.frames.translations.push_back({0.01 * i, 0, 0});
    tables.frames.quaternions.push_back({1, 0, 0, 0});
    tables.frames.timestamps_s.push_back(100.0 + i);
  }
  const McapRecording recording = recording_of(LandmarkMap(std::move(tables)));
  EXPECT_GE(recording.chunks, 3U);
  EXPECT_EQ(recording.of_topic("/tf").size(), kFrames);
  EXPECT_EQ(recording.messages.back().time_ns, (100 + kFrames - 1) * kSecond);
}

TEST_F(McapTest, AMapOfNothingIsARecording) {
  const McapRecording recording = recording_of(LandmarkMap());
  ASSERT_EQ(recording.messages.size(), 1U);
  EXPECT_EQ(recording.messages[0].topic, "/landmarks");
  EXPECT_THAT(Cloud(recording.messages[0]).columns, IsEmpty());
  // Landmarks alone have no keyframes, and one keyframe is no trajectory.
  MapTables tables = testing::plain_tables();
  tables.frames = {};
  tables.observations = {};
  EXPECT_EQ(recording_of(LandmarkMap(tables)).messages.size(), 1U);
  tables.frames.ids = {FrameId{1}};
  tables.frames.translations = {{0, 0, 0}};
  tables.frames.quaternions = {{1, 0, 0, 0}};
  const McapRecording one = recording_of(LandmarkMap(tables));
  EXPECT_THAT(one.of_topic("/trajectory"), IsEmpty());
  EXPECT_EQ(one.messages.size(), 3U);
}

TEST_F(McapTest, SameMapsAreSameBytes) {
  EXPECT_EQ(mcap_of(testing::full_map()), mcap_of(testing::full_map()));
}

TEST_F(McapTest, SaysWhatIsLeftOut) {
  write(testing::full_map(), "full.mcap");
  ASSERT_EQ(remarks_.texts.size(), 1U);
  EXPECT_EQ(remarks_.texts[0],
            "MCAP has no place for: name of the world frame, direction of gravity, georeference, 2 "
            "control points, UUID, "
            "provenance, 2 cameras, names of images, GNSS positions, colours, descriptors 'ORB', 5 "
            "observations, ids of "
            "landmarks, of which some exceed 32 bits, poses of 1 frames without a time; left out");
  const McapRecording recording = testing::read_mcap(testing::read_text(folder_ / "full.mcap"));
  EXPECT_EQ(recording.of_topic("/tf").size(), 2U) << "of the keyframes with a time";
  const Cloud cloud(recording.of_topic("/landmarks").at(0));
  EXPECT_THAT(cloud.names, Not(::testing::Contains("red")));
  EXPECT_THAT(cloud.names, Not(::testing::Contains("id")));
  MapTables tables = testing::plain_tables();
  tables.observations = {};
  write(LandmarkMap(tables), "plain.mcap");
  EXPECT_THAT(remarks_.texts, IsEmpty());
}

TEST_F(McapTest, RefusesWhatItCannotHold) {
  MapTables tables = testing::plain_tables();
  for (const double time : {-0.25, 2e10}) {
    tables.frames.timestamps_s = {1.0, time};
    EXPECT_THAT(
        message_of(ErrorKind::kInput, [&] { mcap_of(LandmarkMap(tables)); }),
        HasSubstr(fmt::format("keyframe 2: is at {} s, which MCAP does not hold; expected 0 "
                              "to 1.8e10 seconds",
                              time)));
  }
  tables.frames.timestamps_s = {};
  tables.landmarks.columns = {{"x", {1, 2, 3}}};
  EXPECT_THAT(message_of(ErrorKind::kMisuse, [&] { mcap_of(LandmarkMap(tables)); }),
              HasSubstr("column 'x': the format has another meaning for this name"));
}

TEST_F(McapTest, IsWrittenByItsEndingAndNeverRead) {
  EXPECT_EQ(all_formats().format_to_write("a.mcap").name, "mcap");
  EXPECT_THAT(all_formats().titles_text(), Not(HasSubstr("MCAP")));
  EXPECT_THAT(all_formats().endings_text(), HasSubstr(".mcap"));
  const auto path = write(testing::plain_map(), "plain.mcap");
  EXPECT_THAT(message_of(ErrorKind::kInput, [&] { read(path); }),
              HasSubstr("is an MCAP recording; expected a map"));
}

TEST_F(McapTest, MapsLieInFramesOfTheirOwn) {
  const LandmarkMap map = testing::plain_map();
  const Rigid3 pose = Rigid3::from_roll_pitch_yaw({1, 2, 3}, 0.1, 0.2, 0.3);
  const std::vector<McapMap> maps = {
      {"monday", {}, [&] { return LandmarkMap(map); }},
      {"tues/day \xff", Similarity3(2.0, pose), [&] { return LandmarkMap(map); }},
      {"robot", Similarity3(Rigid3()), [&] { return LandmarkMap(map); }}};
  const std::vector<McapLink> links = {{0, 1, "placement", 1.0, true},
                                       {1, 2, "placement", 0.25, true},
                                       {2, 0, "manual", std::nullopt, true},
                                       {0, 2, "placement", 0.999, false}};
  std::string bytes;
  write_mcap(maps, links, [&](std::string_view more) { bytes += more; });
  const McapRecording recording = testing::read_mcap(bytes);
  for (const McapMessage& message : recording.messages) EXPECT_EQ(message.time_ns, 0U);

  // Names that are no UTF-8 are written so that they are.
  const std::string frame = "map/tues/day \\xff";
  const auto transforms = recording.of_topic("/tf");
  ASSERT_EQ(transforms.size(), 3U);
  auto fields = protobuf_fields(transforms[1].data);
  EXPECT_EQ(fields.at(2).at(0).bytes, "world");
  EXPECT_EQ(fields.at(3).at(0).bytes, frame);
  EXPECT_EQ(vector_of(fields.at(4).at(0)), pose.translation());
  const Cloud cloud(recording.of_topic("/" + frame + "/landmarks").at(0));
  EXPECT_EQ(cloud.frame, frame);
  EXPECT_EQ(cloud.columns.at("x")[0], 1.0) << "twice the length, as a frame has no scale";
  EXPECT_EQ(cloud.columns.at("cov_zz")[0], 4 * 9e-4);
  EXPECT_EQ(Cloud(recording.of_topic("/map/monday/landmarks").at(0)).columns.at("x")[0], 0.5);
  EXPECT_EQ(line_points(recording.of_topic("/" + frame + "/trajectory").at(0))[1].x(), 0.2);

  const auto entities = protobuf_fields(recording.of_topic("/links").at(0).data).at(2);
  ASSERT_EQ(entities.size(), 4U);
  const Eigen::Vector3d centre =
      (map.landmarks().positions[0] + map.landmarks().positions[1] + map.landmarks().positions[2]) /
      3.0;
  const auto color_of = [&](std::size_t link) {
    const auto line = protobuf_fields(protobuf_fields(entities[link].bytes).at(11).at(0).bytes);
    return vector_of(line.at(6).at(0));
  };
  const auto points = line_points(recording.of_topic("/links").at(0));
  EXPECT_LT((points[0] - centre).norm(), 1e-12);
  EXPECT_LT((points[1] - pose * Eigen::Vector3d(2.0 * centre)).norm(), 1e-12);
  EXPECT_EQ(color_of(0), Eigen::Vector3d(0, 1, 0));
  EXPECT_EQ(color_of(1), Eigen::Vector3d(1, 0.5, 0));
  EXPECT_EQ(color_of(2), Eigen::Vector3d(0.6, 0.6, 0.6));
  EXPECT_EQ(color_of(3), Eigen::Vector3d(1, 0, 1));
  std::map<std::string, std::string> words;
  const auto last = protobuf_fields(entities[3].bytes);
  for (const ProtobufField& word : last.at(6)) {
    auto pair = protobuf_fields(word.bytes);
    words[pair.at(1).at(0).bytes] = pair.at(2).at(0).bytes;
  }
  EXPECT_EQ(words.at("target"), "monday");
  EXPECT_EQ(words.at("source"), "robot");
  EXPECT_EQ(words.at("probability"), "0.999");
  EXPECT_EQ(words.at("poses"), "contradict it");
}

}  // namespace
}  // namespace cairn
