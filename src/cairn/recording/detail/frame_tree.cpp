// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/recording/detail/frame_tree.hpp"

#include <algorithm>
#include <array>
#include <limits>
#include <string_view>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "cairn/core/error.hpp"
#include "cairn/recording/detail/parse_message.hpp"

namespace cairn::detail {
namespace {

// The second is tf's, before ROS had tf2.
constexpr std::array<std::string_view, 2> kTransformTypes = {"tf2_msgs/TFMessage", "tf/tfMessage"};

bool has_transforms(const RecordedTopic& topic) {
  return is_readable(topic) &&
         std::ranges::find(kTransformTypes, topic.type) != kTransformTypes.end();
}

bool has_static_transforms(const RecordedTopic& topic) {
  return has_transforms(topic) && topic.name.ends_with("tf_static");
}

std::string without_slash(const std::string& frame) {
  return frame.substr(frame.starts_with('/') ? 1 : 0);
}

// Calls use(transform) with the transforms of the topics that `is_wanted` picks.
template <class IsWanted, class Use>
void for_each_transform(const Recording& recording, const IsWanted& is_wanted, const Use& use) {
  for (const RecordedMessage& message : recording.messages()) {
    if (!is_wanted(recording.topics()[message.topic])) continue;
    for (FrameTransform& step : parse_message(recording, message, parse_transforms)) {
      step.parent = without_slash(step.parent);
      step.child = without_slash(step.child);
      use(step);
    }
  }
}

}  // namespace

bool has_moving_transforms(const RecordedTopic& topic) {
  return has_transforms(topic) && !has_static_transforms(topic);
}

FrameTree::FrameTree(const Recording& recording, const std::string& moving)
    : place_(recording.name() + ": " + moving) {
  if (!moving.empty()) read_moving(recording, moving);
  for_each_transform(recording, has_static_transforms, [&](const FrameTransform& step) {
    steps_.insert_or_assign(step.child, Step{step.parent, step.parent_from_child, {}});
  });
}

void FrameTree::read_moving(const Recording& recording, const std::string& topic) {
  const auto is_wanted = [&](const RecordedTopic& candidate) {
    return candidate.name == topic && has_moving_transforms(candidate);
  };
  for_each_transform(recording, is_wanted, [&](const FrameTransform& transform) {
    Step& step = steps_.try_emplace(transform.child, Step{transform.parent, {}, {}}).first->second;
    reject_if(step.parent != transform.parent, place_,
              fmt::format("the frame {} has the parents {} and {}", printable(transform.child),
                          printable(step.parent), printable(transform.parent)),
              "one parent for each frame");
    step.moving.push_back({transform.stamp_s, transform.parent_from_child});
  });
  for (auto& [child, step] : steps_) {
    std::ranges::stable_sort(step.moving, {}, &TimedPose::timestamp_s);
    const auto repeated = std::ranges::unique(step.moving, {}, &TimedPose::timestamp_s);
    step.moving.erase(repeated.begin(), repeated.end());
  }
}

FrameTree::Path FrameTree::path_up(const std::string& frame) const {
  Path path{{without_slash(frame)}, {}};
  while (path.steps.size() <= steps_.size()) {  // a loop of frames ends
    const auto found = steps_.find(path.frames.back());
    if (found == steps_.end()) break;
    path.steps.push_back(&found->second);
    path.frames.push_back(found->second.parent);
  }
  return path;
}

std::optional<Rigid3> FrameTree::between(const std::string& target,
                                         const std::string& source) const {
  const auto poses_above = [&](const std::string& frame) {
    const Path path = path_up(frame);
    std::vector<std::pair<std::string, Rigid3>> above = {{path.frames[0], Rigid3()}};
    for (std::size_t i = 0; i < path.steps.size() && path.steps[i]->moving.empty(); ++i) {
      above.emplace_back(path.frames[i + 1],
                         path.steps[i]->parent_from_child * above.back().second);
    }
    return above;
  };
  const auto above_target = poses_above(target);
  for (const auto& [frame, from_source] : poses_above(source)) {
    const auto common =
        std::ranges::find(above_target, frame, [](const auto& entry) { return entry.first; });
    if (common != above_target.end()) return common->second.inverse() * from_source;
  }
  return std::nullopt;
}

Trajectory FrameTree::poses(const std::string& world, const std::string& frame) const {
  Path path = path_up(frame);
  if (!world.empty()) {
    const auto found = std::ranges::find(path.frames, without_slash(world));
    reject_if(found == path.frames.end(), place_,
              fmt::format("the frame {} is not above the camera's frame {}", printable(world),
                          printable(frame)),
              fmt::format("one of {}", fmt::join(path.frames, ", ")));
    path.steps.resize(static_cast<std::size_t>(found - path.frames.begin()));
  }
  std::vector<Trajectory> moving;  // empty for a step that does not change
  for (const Step* step : path.steps) moving.emplace_back(step->moving);
  const auto most = std::ranges::max_element(moving, {}, &Trajectory::size);
  std::vector<TimedPose> poses;
  // As in ROS, transforms are interpolated across any gap, and unknown before and after their times.
  const auto pose_at = [&](double time_s) -> std::optional<Rigid3> {
    Rigid3 from_frame;
    for (std::size_t i = 0; i < moving.size(); ++i) {
      const auto pose = moving[i].empty() ? std::optional(path.steps[i]->parent_from_child)
                                          : interpolated(moving[i], time_s,
                                                         std::numeric_limits<double>::infinity());
      if (!pose) return std::nullopt;
      from_frame = *pose * from_frame;
    }
    return from_frame;
  };
  if (most != moving.end()) {
    for (const TimedPose& at : most->poses()) {
      if (const auto pose = pose_at(at.timestamp_s)) poses.push_back({at.timestamp_s, *pose});
    }
  }
  reject_if(poses.empty(), place_,
            fmt::format("does not move the camera's frame {}, above which are {}", printable(frame),
                        fmt::join(path.frames, ", ")),
            "transforms at common times from the camera's frame to the world's");
  return Trajectory(std::move(poses));
}

}  // namespace cairn::detail
