// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "cairn/core/file.hpp"
#include "cairn/trajectory/trajectory.hpp"

namespace cairn {

/// Reads a trajectory in the format of the TUM RGB-D benchmark: `timestamp tx ty tz qx qy qz qw` per line,
/// seconds and metres, world_from_camera; lines that start with '#' are comments.
/// @param log receives a loss if the last line does not end
/// @throws Error (input) naming source, line, field, value and constraint
Trajectory read_tum_trajectory(ByteSource& source, const LogSink& log = {});

/// Writes that format, numbers as the shortest decimals that parse back.
void write_tum_trajectory(const Trajectory& trajectory, const ByteSink& sink);

}  // namespace cairn
