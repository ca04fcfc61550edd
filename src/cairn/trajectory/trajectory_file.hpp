// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <optional>
#include <span>
#include <string_view>

#include "cairn/core/file.hpp"
#include "cairn/trajectory/trajectory.hpp"

namespace cairn {

/// Formats of trajectories. docs/formats.md has their records.
enum class TrajectoryFormat {
  kTum,    ///< `timestamp tx ty tz qx qy qz qw`, seconds: the TUM RGB-D benchmark
  kEuroc,  ///< `nanoseconds, px, py, pz, qw, qx, qy, qz, ...`: EuRoC and the ASL datasets
  kKitti,  ///< the 12 numbers of [R | t], row-major; the times stand in a file of their own
};

/// "tum", "euroc", "kitti".
std::string_view to_string(TrajectoryFormat format);
std::optional<TrajectoryFormat> trajectory_format(std::string_view name);

/// The format of a text by its first record; nothing if that is no pose.
std::optional<TrajectoryFormat> recognised_trajectory(std::string_view beginning);

/// Reads a trajectory in any of the formats, recognised by its first record. Lines that start with '#' are
/// comments; further columns of EuRoC's (velocity, biases) are passed over.
/// @param times of the poses of a KITTI trajectory, which has none itself; empty: 0, 1, 2, ... seconds
/// @throws Error (input) naming source, line, field, what was found and what was expected
Trajectory read_trajectory(ByteSource& source, std::span<const double> times = {});

/// The same of a file. The times of a KITTI trajectory are those of `times.txt` beside it, if there is one.
Trajectory read_trajectory(const std::filesystem::path& path);

/// Writes a trajectory; numbers are the shortest decimals that parse back, EuRoC's times whole nanoseconds. The
/// times of a KITTI trajectory are not written.
/// @throws Error (misuse) for times that EuRoC's nanoseconds cannot hold or tell apart
void write_trajectory(const Trajectory& trajectory, TrajectoryFormat format, const ByteSink& sink);

}  // namespace cairn
