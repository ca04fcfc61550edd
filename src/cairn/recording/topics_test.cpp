// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/recording/topics.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/core/error.hpp"

#include "support/recordings.hpp"
#include "support/refusal.hpp"
#include "support/temporary_folder.hpp"

namespace cairn {
namespace {

using ::testing::HasSubstr;
using testing::MessageFields;
using testing::WrittenMessages;

// A body that drives along x and turns, with a camera on it that looks along the body's x.
struct PoseTopicsTest : ::testing::TestWithParam<const char*> {
  testing::TemporaryFolder folder;
  WrittenMessages messages;
  const Rigid3 body_from_camera{Eigen::Quaterniond(0.5, -0.5, 0.5, -0.5), {0.1, 0.2, 0.3}};

  static Rigid3 world_from_body(double time_s) {
    return {Eigen::Quaterniond(Eigen::AngleAxisd(0.3 * time_s, Eigen::Vector3d::UnitZ())),
            {2.0 * time_s, 0.5, 0.1}};
  }
  static void add_pose(MessageFields& fields, const Rigid3& pose) {
    const Eigen::Quaterniond q = pose.quaternion();
    const Eigen::Vector3d& t = pose.translation();
    fields.doubles(std::array{t.x(), t.y(), t.z(), q.x(), q.y(), q.z(), q.w()});
  }
  void pose(const std::string& topic, const std::string& type, std::uint64_t time_ns,
            const std::string& parent = "odom") {
    MessageFields fields(GetParam());
    fields.header(time_ns, parent);
    if (type == "nav_msgs/Odometry") fields.text("base");
    add_pose(fields, world_from_body(1e-9 * static_cast<double>(time_ns)));
    messages.push_back({topic, type, messages.size(), fields.bytes()});
  }
  void transform(const std::string& topic, std::uint64_t time_ns, const std::string& parent,
                 const std::string& child, const Rigid3& pose,
                 const std::string& type = "tf2_msgs/TFMessage") {
    MessageFields fields(GetParam());
    fields.number(std::uint32_t{1}).header(time_ns, parent).text(child);
    add_pose(fields, pose);
    messages.push_back({topic, type, messages.size(), fields.bytes()});
  }
  void mount() { transform("/tf_static", 0, "base", "optical", body_from_camera); }
  // A localization that turns with constant speed about the map's origin, stated each second, and odometry each tenth of
  // a second; with old names of frames and types.
  static Rigid3 map_from_odom(double time_s) {
    return {Eigen::Quaterniond(Eigen::AngleAxisd(0.1 * time_s, Eigen::Vector3d::UnitZ())),
            Eigen::Vector3d::Zero()};
  }
  void drive() {
    for (std::uint64_t tenth = 0; tenth <= 25; ++tenth) {
      const std::uint64_t time_ns = 100'000'000 * tenth;
      const double time_s = 0.1 * static_cast<double>(tenth);
      transform("/tf", time_ns, "/odom", "/base", world_from_body(time_s), "tf/tfMessage");
      if (tenth % 10 == 0)
        transform("/tf", time_ns, "map", "odom", map_from_odom(time_s), "tf/tfMessage");
    }
  }
  Recording recording() const {
    const bool is_ros1 = GetParam() == std::string("ros1");
    return Recording(folder.write(
        "a.bag", is_ros1 ? testing::rosbag_bytes(messages) : testing::mcap_bytes(messages)));
  }
  std::string refused(const std::string& topic, const std::string& frame = "optical") const {
    return testing::message_of(ErrorKind::kInput, [&] { camera_poses(recording(), topic, frame); });
  }
};

TEST_P(PoseTopicsTest, TheCameraIsWhereItIsMountedOnTheBody) {
  mount();
  for (const std::uint64_t time_ns : {2'000'000'000U, 1'000'000'000U, 2'000'000'000U}) {
    pose("/odom", "nav_msgs/Odometry", time_ns);
    pose("/pose", "geometry_msgs/PoseStamped", time_ns);
    pose("/amcl", "geometry_msgs/PoseWithCovarianceStamped", time_ns);
  }
  for (const char* const topic : {"/odom", "/pose,base", "/amcl,base"}) {
    const Trajectory camera = camera_poses(recording(), topic, "optical");
    ASSERT_EQ(camera.size(), 2U) << topic;
    for (const TimedPose& timed : camera.poses()) {
      // A point before the camera, 3 m ahead of the body and as high as the camera.
      const Eigen::Vector3d expected =
          world_from_body(timed.timestamp_s) * Eigen::Vector3d(3.1, 0.2, 0.3);
      EXPECT_LT((timed.world_from_camera * Eigen::Vector3d(0, 0, 3) - expected).norm(), 1e-12);
    }
    EXPECT_EQ(camera.poses()[0].timestamp_s, 1.0);
  }
  const auto topics = pose_topics(recording());
  ASSERT_EQ(topics.size(), 3U);
  EXPECT_EQ(topics[1].name, "/odom");
  EXPECT_EQ(topics[1].body, "base");
  EXPECT_EQ(topics[2].body, "");

  messages.insert(messages.begin(), {"/odom", "nav_msgs/Odometry", 0, "short"});
  EXPECT_EQ(pose_topics(recording())[1].body, "") << "listed, and refused where it is used";
  EXPECT_THAT(refused("/odom"), HasSubstr("/odom"));
}

TEST_P(PoseTopicsTest, WhatIsNotKnownIsRefused) {
  pose("/odom", "nav_msgs/Odometry", 1);
  pose("/pose", "geometry_msgs/PoseStamped", 1);
  EXPECT_THAT(refused("/odom"),
              HasSubstr("/odom: tf_static does not say where the camera 'optical' is on the body "
                        "'base'"));
  EXPECT_EQ(camera_poses(recording(), "/odom,optical", "optical").size(), 1U) << "as stated";
  EXPECT_THAT(refused("/pose"), HasSubstr("/pose: does not say whose poses these are; expected "
                                          "topic:/pose,FRAME"));
  EXPECT_THAT(refused("/pose,optical", ""), HasSubstr("where the camera ''"));
  EXPECT_THAT(refused("/imu"), HasSubstr("has no poses '/imu'; expected one of the topics: /odom, "
                                         "/pose"));
  mount();
  pose("/odom", "nav_msgs/Odometry", 2, "map");
  EXPECT_THAT(refused("/odom"), HasSubstr("poses in 'odom' and in 'map'"));
}

TEST_P(PoseTopicsTest, TheCameraMovesInATreeOfTransforms) {
  mount();
  drive();
  const auto topics = pose_topics(recording());
  ASSERT_EQ(topics.size(), 1U) << "and not tf_static";
  EXPECT_EQ(topics[0].name, "/tf");
  EXPECT_TRUE(topics[0].is_tree);

  const Trajectory in_map = camera_poses(recording(), "/tf", "/optical");
  ASSERT_EQ(in_map.size(), 21U) << "where the localization is known, 0 to 2 s";
  for (const TimedPose& timed : in_map.poses()) {
    const double t = timed.timestamp_s;
    const Rigid3 expected = map_from_odom(t) * world_from_body(t) * body_from_camera;
    EXPECT_LT((timed.world_from_camera.matrix() - expected.matrix()).norm(), 1e-9) << t;
  }
  const Trajectory in_odom = camera_poses(recording(), "/tf,odom", "optical");
  ASSERT_EQ(in_odom.size(), 26U);
  EXPECT_LT((in_odom.poses()[25].world_from_camera.matrix() -
             (world_from_body(2.5) * body_from_camera).matrix())
                .norm(),
            1e-9);
}

TEST_P(PoseTopicsTest, TransformsThatDoNotMoveTheCameraAreRefused) {
  drive();
  EXPECT_THAT(refused("/tf"), HasSubstr("/tf: does not move the camera's frame 'optical', above "
                                        "which are optical"));
  mount();
  EXPECT_THAT(
      refused("/tf,world"),
      HasSubstr("/tf: the frame 'world' is not above the camera's frame 'optical'; expected "
                "one of optical, base, odom, map"));
  EXPECT_THAT(refused("/tf,base"), HasSubstr("does not move")) << "the mount is fixed";
  transform("/tf", 9'000'000'000, "map", "base", {});
  EXPECT_THAT(refused("/tf"), HasSubstr("the frame 'base' has the parents 'odom' and 'map'"));
}

TEST_P(PoseTopicsTest, ALoopOfFramesEnds) {
  mount();
  transform("/tf", 1, "optical", "base", {});
  transform("/tf", 2, "optical", "base", {});
  EXPECT_THAT(refused("/tf,world"), HasSubstr("the frame 'world' is not above"));
  EXPECT_THAT(refused("/tf,base"), HasSubstr("does not move"));
}

// What RealSense's own recorder writes: all streams are in a frame "0", and state their cameras and poses beside them.
struct RealSenseTest : ::testing::Test {
  testing::TemporaryFolder folder;
  WrittenMessages messages;
  // The reference is the stream 0, of depth.
  const Rigid3 color_from_depth{
      Eigen::Quaterniond(Eigen::AngleAxisd(0.02, Eigen::Vector3d::UnitY())),
      {0.015, 0.001, -0.002}};

  void add(const std::string& topic, const std::string& type, const std::string& bytes) {
    messages.push_back({topic, type, messages.size(), bytes});
  }
  void stream(const std::string& name, const std::string& encoding, double focal_length,
              const Rigid3& stream_from_reference) {
    CameraInfo info;
    info.header.frame = "0";
    info.width = 4;
    info.height = 2;
    info.intrinsics = {focal_length, 0, 2, 0, focal_length, 1, 0, 0, 1};
    info.distortion_model = "Inverse Brown Conrady";
    info.distortion = {0.1, 0, 0, 0, 0};
    add(name + "/info/camera_info", "sensor_msgs/CameraInfo",
        testing::camera_info_bytes("ros1", info));
    MessageFields pose("ros1");
    PoseTopicsTest::add_pose(pose, stream_from_reference);
    add(name + "/tf/0", "geometry_msgs/Transform", pose.bytes());
    const std::string pixels(24, '\1');
    ImageMessage image;
    image.header.frame = "0";
    image.width = 4;
    image.height = 2;
    image.encoding = encoding;
    image.row_bytes = encoding == "rgb8" ? 12 : 8;
    image.data = std::string_view(pixels).substr(0, 2 * image.row_bytes);
    add(name + "/image/data", "sensor_msgs/Image", testing::image_bytes("ros1", 1, image));
  }
  void unit(float metres) {
    add("/device_0/sensor_0/option/Depth_Units/value", "std_msgs/Float32",
        MessageFields("ros1").number(metres).bytes());
  }
  Recording recording() const {
    return Recording(folder.write("a.bag", testing::rosbag_bytes(messages)));
  }
};

TEST_F(RealSenseTest, StreamsHaveTheirOwnCamerasAndPoses) {
  stream("/device_0/sensor_0/Depth_0", "mono16", 385.0, Rigid3());
  stream("/device_0/sensor_1/Color_0", "rgb8", 610.0, color_from_depth);
  const Recording bag = recording();
  const SensorTopics chosen = choose_topics(bag, image_topics(bag));
  EXPECT_FALSE(chosen.is_stereo());
  EXPECT_EQ(chosen.image.info->intrinsics[0], 610.0);
  EXPECT_EQ(chosen.depth_or_right.info->intrinsics[0], 385.0);
  EXPECT_EQ(camera_of(*chosen.image.info, false, "").model, "OPENCV");
  const auto pose = image_from_partner(bag, chosen);
  ASSERT_TRUE(pose);
  const Rigid3 error = pose->inverse() * color_from_depth;
  EXPECT_LT(error.angle() + error.translation().norm(), 1e-12);
  EXPECT_FALSE(depth_unit_m(bag, chosen.depth_or_right)) << "as ROS has it";
}

TEST_F(RealSenseTest, StreamsWithoutACommonReferenceHaveNoKnownPose) {
  stream("/device_0/sensor_0/Depth_0", "mono16", 385.0, Rigid3());
  stream("/device_0/sensor_1/Color_0", "rgb8", 610.0, color_from_depth);
  messages.erase(messages.begin() + 1);
  const Recording bag = recording();
  EXPECT_FALSE(image_from_partner(bag, choose_topics(bag, image_topics(bag))))
      << "equal frames, but not one camera";
}

TEST_F(RealSenseTest, TheUnitOfDepthIsThatOfTheSensor) {
  stream("/device_0/sensor_0/Depth_0", "mono16", 385.0, Rigid3());
  unit(0.00025F);
  const Recording bag = recording();
  EXPECT_NEAR(depth_unit_m(bag, image_topics(bag)[0]).value_or(0.0), 0.00025, 1e-9);
  messages.pop_back();
  unit(0.0F);
  const Recording wrong = recording();
  EXPECT_THAT(
      testing::message_of(ErrorKind::kInput, [&] { depth_unit_m(wrong, image_topics(wrong)[0]); }),
      HasSubstr("Depth_Units/value: 0; expected the length of a unit of depth in metres"));
}

INSTANTIATE_TEST_SUITE_P(Encodings, PoseTopicsTest, ::testing::Values("ros1", "cdr", "cdr-be"));

}  // namespace
}  // namespace cairn
