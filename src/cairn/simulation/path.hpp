// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <string_view>

#include "cairn/core/option_table.hpp"
#include "cairn/geometry/trajectory.hpp"
#include "cairn/simulation/environment.hpp"

namespace cairn {

/// Motion of a simulated camera.
enum class PathKind {
  kSweep,  ///< handheld, along the environment's viewpoints, back and forth
  kOrbit,  ///< around the environment's centre, looking at it
  kWalk,   ///< at walking pace along the environment's closed path, facing ahead and aside
};

/// "sweep", "orbit" or "walk".
/// @throws Error (misuse) for another name
PathKind path_kind(std::string_view name);

struct PathOptions {
  PathKind kind = PathKind::kSweep;
  std::uint64_t seed = 1;     ///< seed of start, deviations and shake
  std::size_t frames = 300;   ///< 1 to a million
  double rate_hz = 30.0;      ///< frames per second; 0.1 to 1000
  double pace = 1.0;          ///< speed factor; 0.01 to 5
  double shake = 1.0;         ///< factor on the camera shake; 0 to 5
  double clearance_m = 0.15;  ///< least distance of the camera from any surface; 0 to 1

  static const OptionTable table;
  /// @throws Error (misuse) naming the field
  void validate() const;
};

/// A path through an environment: poses world_from_camera (x right, y down, z forward) at times 0,
/// 1 / rate, ... in whole microseconds. Each pose, and each midpoint between consecutive poses, is
/// at least `clearance_m` from all surfaces.
/// @throws Error (misuse) if no such path was found
Trajectory make_path(const Environment& environment, const PathOptions& options = {});

/// Interpolated pose at a time: linear position, shortest rotation. Times outside the trajectory
/// give the first or last pose. The trajectory must not be empty.
Rigid3 pose_at(const Trajectory& trajectory, double timestamp_s);

/// Interpolates a trajectory at a constant rate from its start.
/// @param frames largest number of poses; 0: up to the trajectory's end
/// @throws Error (misuse) for an empty trajectory or a rate that is not positive
Trajectory resampled(const Trajectory& trajectory, double rate_hz, std::size_t frames = 0);

/// Pose world_from_camera of an upright camera that faces a point: x is horizontal.
Rigid3 looking_at(const Eigen::Vector3d& position, const Eigen::Vector3d& target);

}  // namespace cairn
