// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <span>
#include <string>

#include "cairn/odometry/map_sequence.hpp"
#include "cairn/pose_graph/pose_graph.hpp"

namespace cairn {

/// A sequence's mini-maps as a graph: a node each, whose id is its place in time, and a link between
/// neighbours, of kind odometry. Poses are in the frame of the first mini-map, by the links alone. The session
/// is a UUID made of the maps' content.
/// @param names one a mini-map
PoseGraph pose_graph(const MappedSequence& mapped, std::span<const std::string> names);

}  // namespace cairn
