// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/geometry/trajectory.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>

#include <fmt/format.h>

#include "cairn/core/detail/time_association.hpp"
#include "cairn/core/error.hpp"
#include "cairn/geometry/limits.hpp"

namespace cairn {
namespace {

auto first_not_before(std::span<const TimedPose> poses, double timestamp_s) {
  return std::lower_bound(
      poses.begin(), poses.end(), timestamp_s,
      [](const TimedPose& pose, double time) { return pose.timestamp_s < time; });
}

}  // namespace

Trajectory::Trajectory(std::vector<TimedPose> poses) : poses_(std::move(poses)) {
  for (std::size_t i = 0; i < poses_.size(); ++i) {
    const double time = poses_[i].timestamp_s;
    const std::string_view defect = coordinate_defect(poses_[i].world_from_camera);
    if (!defect.empty()) {
      throw Error(ErrorKind::kInput, fmt::format("pose {}", i), defect, kExpectedCoordinates);
    }
    if (!(std::abs(time) <= kLargestTimestamp)) {
      throw Error(ErrorKind::kInput, fmt::format("pose {}", i), fmt::format("timestamp {}", time),
                  "seconds, from -1e20 to 1e20");
    }
    if (i > 0 && time <= poses_[i - 1].timestamp_s) {
      throw Error(ErrorKind::kInput, fmt::format("pose {}", i),
                  fmt::format("timestamp {:.6f} after {:.6f}", time, poses_[i - 1].timestamp_s),
                  "ascending timestamps, each once");
    }
  }
}

double Trajectory::duration_s() const {
  return empty() ? 0.0 : poses_.back().timestamp_s - poses_.front().timestamp_s;
}

double Trajectory::length() const {
  double sum = 0.0;
  for (std::size_t i = 1; i < poses_.size(); ++i) {
    sum +=
        (poses_[i].world_from_camera.translation() - poses_[i - 1].world_from_camera.translation())
            .norm();
  }
  return sum;
}

Trajectory transformed(const Trajectory& trajectory, const Similarity3& new_from_old) {
  std::vector<TimedPose> poses(trajectory.poses().begin(), trajectory.poses().end());
  for (TimedPose& pose : poses) {
    const Rigid3& old = pose.world_from_camera;
    pose.world_from_camera = Rigid3(new_from_old.rigid().quaternion() * old.quaternion(),
                                    new_from_old * old.translation());
  }
  return Trajectory(std::move(poses));
}

const TimedPose* nearest_pose(const Trajectory& trajectory, double timestamp_s) {
  const auto poses = trajectory.poses();
  if (poses.empty()) return nullptr;
  const auto after = first_not_before(poses, timestamp_s);
  if (after == poses.begin()) return &*after;
  const auto before = std::prev(after);
  const bool is_after =
      after != poses.end() && after->timestamp_s - timestamp_s < timestamp_s - before->timestamp_s;
  return is_after ? &*after : &*before;
}

std::optional<Rigid3> interpolated(const Trajectory& trajectory, double timestamp_s,
                                   double max_gap_s) {
  const auto poses = trajectory.poses();
  const auto after = first_not_before(poses, timestamp_s);
  if (after == poses.end()) return std::nullopt;
  if (after->timestamp_s == timestamp_s) return after->world_from_camera;
  if (after == poses.begin()) return std::nullopt;
  const auto before = std::prev(after);
  const double gap = after->timestamp_s - before->timestamp_s;
  if (gap > max_gap_s) return std::nullopt;
  const double share = (timestamp_s - before->timestamp_s) / gap;
  const Vector6d motion = before->world_from_camera.difference_to(after->world_from_camera);
  return before->world_from_camera.perturbed(share * motion);
}

PosePairs associate(const Trajectory& a, const Trajectory& b, double max_difference_s) {
  const auto times = [](const Trajectory& trajectory) {
    std::vector<double> result;
    result.reserve(trajectory.size());
    for (const TimedPose& pose : trajectory.poses()) result.push_back(pose.timestamp_s);
    return result;
  };
  return detail::associate_times(times(a), times(b), max_difference_s);
}

}  // namespace cairn
