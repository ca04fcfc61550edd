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
  void mount() {
    MessageFields fields(GetParam());
    fields.number(std::uint32_t{1}).header(0, "base").text("optical");
    add_pose(fields, body_from_camera);
    messages.push_back({"/tf_static", "tf2_msgs/TFMessage", messages.size(), fields.bytes()});
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

INSTANTIATE_TEST_SUITE_P(Encodings, PoseTopicsTest, ::testing::Values("ros1", "cdr", "cdr-be"));

}  // namespace
}  // namespace cairn
