// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/vision/detail/corrected_trajectory.hpp"

#include <utility>
#include <vector>

#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/geometry/detail/pose_between.hpp"

namespace cairn::detail {
namespace {

Rigid3 carried(const CorrectedKeyframe& by, const Rigid3& world_from_camera) {
  return by.after * (by.before.inverse() * world_from_camera);
}

}  // namespace

Trajectory corrected(const Trajectory& trajectory, std::span<const CorrectedKeyframe> keyframes) {
  refuse_if(keyframes.empty(), "keyframes", "none", "at least one");
  for (std::size_t i = 1; i < keyframes.size(); ++i) {
    if (keyframes[i].timestamp_s > keyframes[i - 1].timestamp_s) continue;
    throw Error(ErrorKind::kMisuse, "keyframes",
                fmt::format("{:.6f} s after {:.6f} s", keyframes[i].timestamp_s,
                            keyframes[i - 1].timestamp_s),
                "keyframes in the order of time, each once");
  }
  std::vector<TimedPose> poses(trajectory.poses().begin(), trajectory.poses().end());
  std::size_t next = 0;  // first keyframe that is later
  for (TimedPose& pose : poses) {
    while (next < keyframes.size() && keyframes[next].timestamp_s <= pose.timestamp_s) ++next;
    if (next == 0 || next == keyframes.size()) {
      pose.world_from_camera =
          carried(next == 0 ? keyframes.front() : keyframes.back(), pose.world_from_camera);
      continue;
    }
    const CorrectedKeyframe& earlier = keyframes[next - 1];
    const CorrectedKeyframe& later = keyframes[next];
    const double share =
        (pose.timestamp_s - earlier.timestamp_s) / (later.timestamp_s - earlier.timestamp_s);
    pose.world_from_camera = pose_between(carried(earlier, pose.world_from_camera),
                                          carried(later, pose.world_from_camera), share);
  }
  return Trajectory(std::move(poses));
}

}  // namespace cairn::detail
