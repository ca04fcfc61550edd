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

/// The format of a text, by its first record; std::nullopt if the record is not a pose.
std::optional<TrajectoryFormat> recognised_trajectory(std::string_view beginning);

/// Reads a trajectory in any of the formats, recognised by its first record. Lines that start with
/// '#' are comments. A line of column names, commented or not, defines the columns. Ignores columns
/// that do not belong to a pose. Times from 1e17 are nanoseconds. Sorts poses by time.
/// @param times seconds, one per pose of a KITTI trajectory; empty: 0, 1, 2, ...
/// @param log receives a loss remark on poses omitted because of unknown numbers (NaN or empty) or
///        repeated times, a loss remark if the last line has no line end, and information on how
///        unnamed columns, unsorted times and large times are read
/// @throws Error (input) naming source, line, field, value and constraint; also if most poses share
///        their time with another pose
Trajectory read_trajectory(ByteSource& source, std::span<const double> times = {},
                           const LogSink& log = {});

/// Reads a trajectory from a file; for KITTI, with the times from `times.txt` in the same folder,
/// if it exists. Reads a folder as 7-Scenes poses, with `frame-000012.pose.txt` at 12 s. Converts
/// ICL-NUIM poses, `*.gt.freiburg`, from y up to y down, with a remark.
Trajectory read_trajectory(const std::filesystem::path& path, const LogSink& log = {});

/// Writes a trajectory with the shortest decimals that parse back; EuRoC's times are whole
/// nanoseconds. Does not write the times of a KITTI trajectory.
/// @throws Error (misuse) for times that EuRoC's nanoseconds cannot represent or distinguish
void write_trajectory(const Trajectory& trajectory, TrajectoryFormat format, const ByteSink& sink);

}  // namespace cairn
