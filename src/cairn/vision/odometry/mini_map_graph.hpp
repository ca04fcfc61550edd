// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <span>
#include <string>

#include "cairn/pose_graph/pose_graph.hpp"
#include "cairn/vision/odometry/map_sequence.hpp"

namespace cairn {

/// The mini-maps of a sequence as a graph: a node for each, with its position in time as id, and odometry
/// links between neighbours. Poses are in the frame of the first mini-map, from the links alone. The
/// session is a UUID of the maps' content.
/// @param names one per mini-map
PoseGraph pose_graph(const MappedSequence& mapped, std::span<const std::string> names);

}  // namespace cairn
