// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <span>

#include "cairn/vision/detail/landmark_graph.hpp"

namespace cairn::detail {

/// Moves keyframes and the landmarks that they observe to minimise the squared residuals (pixel and depth, each
/// divided by its standard deviation, with Huber's kernel). Other keyframes that observe these landmarks are fixed.
/// Landmarks with only one observation move with their first keyframe. Then removes observations that the noise does
/// not explain, and landmarks without observations.
/// @param moving indices of the keyframes to move, each once
void adjust(LandmarkGraph& graph, std::span<const std::uint32_t> moving, int max_iterations = 5);

/// The same for single landmarks with all keyframes fixed, by Gauss-Newton. Removes no observations.
void adjust_landmarks(LandmarkGraph& graph, std::span<const LandmarkIndex> landmarks);

/// Removes observations and disables depths that the noise does not explain, and removes landmarks without
/// observations.
void drop_outliers(LandmarkGraph& graph, std::span<const LandmarkIndex> landmarks);

}  // namespace cairn::detail
