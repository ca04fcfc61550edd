// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/recording/topics.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <string_view>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "cairn/core/error.hpp"
#include "cairn/core/text.hpp"
#include "cairn/recording/detail/frame_tree.hpp"
#include "cairn/recording/detail/parse_message.hpp"

namespace cairn {
namespace {

using detail::is_readable;
using detail::parse_message;

constexpr std::string_view kImageType = "sensor_msgs/Image";
constexpr std::string_view kCompressedType = "sensor_msgs/CompressedImage";
constexpr std::string_view kInfoType = "sensor_msgs/CameraInfo";

std::string up_from(const std::string& name) {
  return name.substr(0, std::min(name.rfind('/'), name.size()));
}

// The stream of a topic of RealSense's own recordings: /device_0/sensor_1/Color_0 of /device_0/sensor_1/Color_0/image/data.
// All its images are in a frame "0".
std::optional<std::string> realsense_stream(const std::string& topic) {
  constexpr std::string_view kEnd = "/image/data";
  if (!topic.starts_with("/device_") || !topic.ends_with(kEnd)) return std::nullopt;
  return topic.substr(0, topic.size() - kEnd.size());
}

// The topic of the raw images that a transport compresses: NAME of NAME/compressed.
std::string raw_name(const RecordedTopic& topic) {
  return topic.type == kCompressedType && topic.name.find("/compressed") != std::string::npos
             ? up_from(topic.name)
             : topic.name;
}

// The first message of each topic.
std::map<std::uint32_t, RecordedMessage> first_messages(const Recording& recording) {
  std::map<std::uint32_t, RecordedMessage> first;
  for (const RecordedMessage& message : recording.messages()) first.emplace(message.topic, message);
  return first;
}

// Depth says so by its pixels, or by its name where other images have such pixels too.
bool is_depth_image(const std::string& encoding, const std::string& topic) {
  return encoding == "16UC1" || encoding == "32FC1" ||
         encoding.find("compressedDepth") != std::string::npos ||
         (lower_case(topic).find("depth") != std::string::npos &&
          (encoding == "mono16" || encoding.starts_with("16UC1")));
}

std::vector<std::pair<std::string, CameraInfo>> camera_infos(
    const Recording& recording, const std::map<std::uint32_t, RecordedMessage>& first) {
  std::vector<std::pair<std::string, CameraInfo>> infos;
  for (const auto& [index, message] : first) {
    const RecordedTopic& topic = recording.topics()[index];
    if (topic.type != kInfoType || !is_readable(topic)) continue;
    infos.emplace_back(topic.name, parse_message(recording, message, parse_camera_info));
  }
  return infos;
}

std::string choices(const Recording& recording, const std::vector<ImageTopic>& topics) {
  std::vector<std::string> names;
  for (const ImageTopic& topic : topics) {
    names.push_back(recording.topics()[topic.topic].name + (topic.is_depth ? " (depth)" : ""));
  }
  return names.empty() ? "none" : fmt::format("{}", fmt::join(names, ", "));
}

// The right one's P has -fx * baseline.
bool is_right_of(const ImageTopic& a, const ImageTopic& b) {
  return a.info && b.info && a.info->projection[3] < b.info->projection[3];
}

SensorTopics given_topics(const Recording& recording, const std::vector<ImageTopic>& topics,
                          const std::string& given) {
  const std::size_t comma = given.find(',');
  const auto named = [&](const std::string& name) -> const ImageTopic& {
    const auto found = std::find_if(topics.begin(), topics.end(), [&](const ImageTopic& topic) {
      return recording.topics()[topic.topic].name == name;
    });
    reject_if(found == topics.end(), recording.name(), "has no images " + printable(name),
              "one of the topics: " + choices(recording, topics));
    return *found;
  };
  refuse_if(comma == std::string::npos, "topics", printable(given),
            "two topics with a comma between them: image and depth, or left and right");
  SensorTopics chosen{named(given.substr(0, comma)), named(given.substr(comma + 1))};
  reject_if(chosen.image.is_depth, recording.name(), given.substr(0, comma) + " are depth images",
            "the topic of the images first");
  return chosen;
}

// The transform of two of RealSense's streams: /device_0/sensor_1/Color_0/tf/3 is the pose of the reference stream 3 in the
// stream Color_0.
std::optional<Rigid3> realsense_transform(const Recording& recording, const std::string& target,
                                          const std::string& source) {
  std::map<std::string, Rigid3> target_from;  // by reference
  std::map<std::string, Rigid3> source_from;
  for (const auto& [index, message] : first_messages(recording)) {
    const RecordedTopic& topic = recording.topics()[index];
    if (topic.type != "geometry_msgs/Transform") continue;
    const std::string reference = topic.name.substr(topic.name.rfind('/') + 1);
    for (const auto& [stream, from] : {std::pair{&target, &target_from}, {&source, &source_from}}) {
      if (topic.name != *stream + "/tf/" + reference) continue;
      from->emplace(reference, parse_message(recording, message, parse_transform));
    }
  }
  for (const auto& [reference, pose] : target_from) {
    const auto other = source_from.find(reference);
    if (other != source_from.end()) return pose * other->second.inverse();
  }
  return std::nullopt;
}

constexpr std::array<std::string_view, 3> kPoseTypes = {
    "nav_msgs/Odometry", "geometry_msgs/PoseStamped", "geometry_msgs/PoseWithCovarianceStamped"};

bool has_poses(const RecordedTopic& topic) {
  return is_readable(topic) && std::ranges::find(kPoseTypes, topic.type) != kPoseTypes.end();
}

FrameTransform pose_of(const Recording& recording, const RecordedMessage& message) {
  return parse_message(recording, message, [&](const MessageBytes& bytes) {
    return parse_pose(bytes, recording.topics()[message.topic].type);
  });
}

}  // namespace

bool is_rectified_topic(const std::string& name) {
  return name.find("image_rect") != std::string::npos;
}

std::vector<ImageTopic> image_topics(const Recording& recording) {
  const auto first = first_messages(recording);
  const auto infos = camera_infos(recording, first);
  const auto is_recorded_raw = [&](const std::string& name) {
    return std::any_of(first.begin(), first.end(), [&](const auto& entry) {
      const RecordedTopic& topic = recording.topics()[entry.first];
      return topic.type == kImageType && topic.name == name;
    });
  };
  std::vector<ImageTopic> found;
  for (const auto& [index, message] : first) {
    const RecordedTopic& topic = recording.topics()[index];
    const std::string raw = raw_name(topic);
    if ((topic.type != kImageType && topic.type != kCompressedType) || !is_readable(topic))
      continue;
    if (raw != topic.name && is_recorded_raw(raw)) continue;
    ImageTopic& image = found.emplace_back();
    image.topic = index;
    parse_message(recording, message, [&](const MessageBytes& bytes) {
      const ImageMessage parsed = parse_image(bytes, topic.type);
      image.is_depth = is_depth_image(parsed.encoding, topic.name);
      image.frame = parsed.header.frame;
    });
    const auto stream = realsense_stream(raw);
    const std::string beside =
        stream ? *stream + "/info/camera_info" : up_from(raw) + "/camera_info";
    for (const auto& [name, info] : infos) {
      const bool is_of_frame = !stream && !image.info && info.header.frame == image.frame;
      if (name == beside || is_of_frame) image.info = info;
    }
  }
  std::sort(found.begin(), found.end(), [&](const ImageTopic& a, const ImageTopic& b) {
    return recording.topics()[a.topic].name < recording.topics()[b.topic].name;
  });
  return found;
}

SensorTopics choose_topics(const Recording& recording, const std::vector<ImageTopic>& topics,
                           const std::string& given) {
  if (!given.empty()) return given_topics(recording, topics, given);
  std::vector<ImageTopic> depths;
  std::vector<ImageTopic> images;
  for (const ImageTopic& topic : topics) (topic.is_depth ? depths : images).push_back(topic);
  if (images.size() == 1 && depths.size() == 1) return {images[0], depths[0]};
  const bool is_pair = images.size() == 2 && depths.empty();
  reject_if(!is_pair, recording.name(),
            fmt::format("{} topics of images, {} of depth: {}", images.size(), depths.size(),
                        choices(recording, topics)),
            "one of each, or two of images; or --topics with the two to use");
  if (is_right_of(images[0], images[1])) std::swap(images[0], images[1]);
  return {images[0], images[1]};
}

std::optional<Rigid3> image_from_partner(const Recording& recording, const SensorTopics& topics) {
  const auto image = realsense_stream(recording.topics()[topics.image.topic].name);
  const auto partner = realsense_stream(recording.topics()[topics.depth_or_right.topic].name);
  if (image && partner) return realsense_transform(recording, *image, *partner);
  if (topics.is_stereo()) {
    const bool are_rectified = is_rectified_topic(recording.topics()[topics.image.topic].name);
    const auto stated = left_from_right(*topics.image.info, *topics.depth_or_right.info,
                                        are_rectified, recording.name() + ": a CameraInfo");
    if (stated) return stated;
  }
  return static_transform(recording, topics.image.frame, topics.depth_or_right.frame);
}

std::optional<double> depth_unit_m(const Recording& recording, const ImageTopic& depth) {
  const auto stream = realsense_stream(recording.topics()[depth.topic].name);
  if (!stream) return std::nullopt;
  const std::string options = up_from(*stream) + "/option/";
  for (const auto& [index, message] : first_messages(recording)) {
    const RecordedTopic& topic = recording.topics()[index];
    const bool is_unit =
        topic.name == options + "Depth_Units/value" || topic.name == options + "Depth Units/value";
    if (!is_unit || topic.type != "std_msgs/Float32") continue;
    const float unit = parse_message(recording, message, parse_float);
    reject_if(!(unit > 0.0F && std::isfinite(unit)), recording.name() + ": " + topic.name,
              fmt::format("{}", unit), "the length of a unit of depth in metres");
    return unit;
  }
  return std::nullopt;
}

std::optional<Rigid3> static_transform(const Recording& recording, const std::string& target,
                                       const std::string& source) {
  return detail::FrameTree(recording).between(target, source);
}

std::vector<PoseTopic> pose_topics(const Recording& recording) {
  std::vector<PoseTopic> found;
  std::vector<bool> is_known(recording.topics().size());
  for (const RecordedMessage& message : recording.messages()) {
    const RecordedTopic& topic = recording.topics()[message.topic];
    const bool is_tree = detail::has_moving_transforms(topic);
    if (is_known[message.topic] || !(has_poses(topic) || is_tree)) continue;
    is_known[message.topic] = true;
    found.push_back({topic.name, "", is_tree});
    if (is_tree) continue;
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
  const bool is_tree = std::ranges::any_of(recording.topics(), [&](const RecordedTopic& topic) {
    return topic.name == name && detail::has_moving_transforms(topic);
  });
  if (is_tree) return detail::FrameTree(recording, name).poses(body, camera_frame);
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
