// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "cairn/geometry/rigid3.hpp"
#include "cairn/geometry/similarity3.hpp"

namespace cairn {

/// Pose of a camera at a time.
struct TimedPose {
  double timestamp_s = 0.0;
  Rigid3 world_from_camera;
  /// The time as a file states it in nanoseconds, which `timestamp_s` rounds; std::nullopt if it does not.
  std::optional<std::int64_t> timestamp_ns = {};
};

/// Poses of a camera, ordered by time. Valid and immutable.
class Trajectory {
 public:
  /// An empty trajectory.
  Trajectory() = default;
  /// @throws Error (input) unless the timestamps ascend strictly, and timestamps and positions are within
  ///        the limits (cairn/geometry/limits.hpp)
  explicit Trajectory(std::vector<TimedPose> poses);

  std::span<const TimedPose> poses() const { return poses_; }
  std::size_t size() const { return poses_.size(); }
  bool empty() const { return poses_.empty(); }
  /// Time from the first pose to the last; 0 for fewer than two poses.
  double duration_s() const;
  /// Length of the path through the camera centres, in the unit of the poses.
  double length() const;

 private:
  std::vector<TimedPose> poses_;
};

/// The trajectory in another world frame.
Trajectory transformed(const Trajectory& trajectory, const Similarity3& new_from_old);

/// The pose nearest in time, the earlier one for a tie; null for an empty trajectory.
const TimedPose* nearest_pose(const Trajectory& trajectory, double timestamp_s);

/// The pose at a time, interpolated between its neighbours (linear position, constant angular velocity).
/// std::nullopt outside the trajectory, or if the neighbours are more than `max_gap_s` apart.
std::optional<Rigid3> interpolated(const Trajectory& trajectory, double timestamp_s,
                                   double max_gap_s = 0.1);

/// Pairs of pose indices in two trajectories.
using PosePairs = std::vector<std::pair<std::size_t, std::size_t>>;

/// Pairs poses of two trajectories by time, as in the TUM benchmark's associate.py: greedily,
/// closest first, each pose at most once, with differences below `max_difference_s`.
PosePairs associate(const Trajectory& a, const Trajectory& b, double max_difference_s = 0.02);

}  // namespace cairn
