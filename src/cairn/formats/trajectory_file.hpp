// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <optional>
#include <span>
#include <string_view>

#include "cairn/core/file.hpp"
#include "cairn/geometry/trajectory.hpp"

namespace cairn {

/// Formats of trajectories; docs/formats.md specifies the records.
enum class TrajectoryFormat {
  kTum,    ///< `timestamp tx ty tz qx qy qz qw`, seconds: the TUM RGB-D benchmark
  kEuroc,  ///< `nanoseconds, px, py, pz, qw, qx, qy, qz, ...`: EuRoC and the ASL datasets
  kKitti,  ///< the 12 numbers of [R | t], row-major; times are in a separate file
};

/// "tum", "euroc", "kitti".
std::string_view to_string(TrajectoryFormat format);
std::optional<TrajectoryFormat> trajectory_format(std::string_view name);

/// The format of a text, by its first record; std::nullopt if that is not a pose.
std::optional<TrajectoryFormat> recognised_trajectory(std::string_view beginning);

/// Reads a trajectory in any of the formats, recognised by its first record. Lines that start with '#' are
/// comments. A line that names the columns, commented or not, decides their meaning. Ignores other columns.
/// Times of 1e17 and more are nanoseconds. Poses are ordered by time.
/// @param times of the poses of a KITTI trajectory, which has none; empty: 0, 1, 2, ... seconds
/// @param log receives a loss that counts poses with unknown numbers (NaN, empty) and those with the time of an
///        earlier one, which are left out, and one if the last line does not end; and how unnamed columns,
///        unsorted and large times were read
/// @throws Error (input) naming source, line, field, value and constraint; also if most poses share their time
///         with another pose
Trajectory read_trajectory(ByteSource& source, std::span<const double> times = {},
                           const LogSink& log = {});

/// The same from a file. A KITTI trajectory takes the times from `times.txt` in its folder, if it exists. Of a folder the
/// poses of 7-Scenes, `frame-000012.pose.txt` at 12 s. The poses of ICL-NUIM, `*.gt.freiburg`, have y up and are brought to
/// cameras with y down; a remark says so.
Trajectory read_trajectory(const std::filesystem::path& path, const LogSink& log = {});

/// Writes a trajectory; numbers are the shortest decimals that parse back, EuRoC's times whole nanoseconds.
/// Does not write the times of a KITTI trajectory.
/// @throws Error (misuse) for times that EuRoC's nanoseconds cannot represent or distinguish
void write_trajectory(const Trajectory& trajectory, TrajectoryFormat format, const ByteSink& sink);

}  // namespace cairn
