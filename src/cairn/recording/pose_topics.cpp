// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/recording/pose_topics.hpp"

#include <algorithm>
#include <array>
#include <optional>
#include <string_view>

#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/recording/messages.hpp"
#include "cairn/recording/sensor_topics.hpp"

namespace cairn {
namespace {

constexpr std::array<std::string_view, 3> kPoseTypes = {
    "nav_msgs/Odometry", "geometry_msgs/PoseStamped", "geometry_msgs/PoseWithCovarianceStamped"};

bool has_poses(const RecordedTopic& topic) {
  return (topic.encoding == "cdr" || topic.encoding == "ros1") &&
         std::ranges::find(kPoseTypes, topic.type) != kPoseTypes.end();
}

FrameTransform pose_of(const Recording& recording, const RecordedMessage& message) {
  const RecordedTopic& topic = recording.topics()[message.topic];
  const std::string bytes = recording.read(message);
  return parse_pose({bytes, topic.encoding, recording.name() + ": " + topic.name}, topic.type);
}

}  // namespace

std::vector<PoseTopic> pose_topics(const Recording& recording) {
  std::vector<PoseTopic> found;
  std::vector<bool> is_known(recording.topics().size());
  for (const RecordedMessage& message : recording.messages()) {
    const RecordedTopic& topic = recording.topics()[message.topic];
    if (is_known[message.topic] || !has_poses(topic)) continue;
    is_known[message.topic] = true;
    found.push_back({topic.name, ""});
    try {
      found.back().body = pose_of(recording, message).child;
    } catch (const Error&) {  // who uses the topic is told
    }
  }
  std::ranges::sort(found, {}, &PoseTopic::name);
  return found;
}

Trajectory camera_poses(const Recording& recording, const std::string& given,
                        const std::string& camera_frame) {
  const std::string name = given.substr(0, given.find(','));
  std::string body = name.size() < given.size() ? given.substr(name.size() + 1) : "";
  const std::string place = recording.name() + ": " + name;
  std::vector<FrameTransform> poses;
  for (const RecordedMessage& message : recording.messages()) {
    const RecordedTopic& topic = recording.topics()[message.topic];
    if (topic.name == name && has_poses(topic)) poses.push_back(pose_of(recording, message));
  }
  if (poses.empty()) {
    std::string names;
    for (const PoseTopic& topic : pose_topics(recording)) {
      names += (names.empty() ? "" : ", ") + topic.name;
    }
    throw Error(ErrorKind::kInput, recording.name(), "has no poses " + printable(name),
                "one of the topics: " + (names.empty() ? "none" : names));
  }
  if (body.empty()) body = poses.front().child;
  reject_if(body.empty(), place, "does not say whose poses these are",
            fmt::format("topic:{},FRAME with the frame of the body that carries the camera", name));
  const auto body_from_camera = static_transform(recording, body, camera_frame);
  reject_if(!body_from_camera, place,
            fmt::format("tf_static does not say where the camera {} is on the body {}",
                        printable(camera_frame), printable(body)),
            "transforms that connect them, or the frame of the camera itself");
  std::ranges::stable_sort(poses, {}, &FrameTransform::stamp_s);
  std::vector<TimedPose> timed;
  for (const FrameTransform& pose : poses) {
    reject_if(pose.parent != poses.front().parent || pose.child != poses.front().child, place,
              fmt::format("poses in {} and in {}", printable(poses.front().parent),
                          printable(pose.parent)),
              "poses of one body in one frame");
    if (!timed.empty() && timed.back().timestamp_s == pose.stamp_s) continue;
    timed.push_back({pose.stamp_s, pose.parent_from_child * *body_from_camera});
  }
  return Trajectory(std::move(timed));
}

}  // namespace cairn
