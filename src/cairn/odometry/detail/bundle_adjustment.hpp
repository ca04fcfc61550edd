// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "cairn/odometry/landmark_graph.hpp"

namespace cairn {

struct AdjustmentOptions {
  int max_iterations = 5;
  /// Landmarks with fewer observations move with their first keyframe only. At least 1.
  std::size_t min_observations = 2;
};

/// Moves keyframes and the landmarks they observe so that the squared measurement residuals (pixel
/// and depth, each over its standard deviation, Huber's kernel) become least. Keyframes that observe
/// the same landmarks but are not in `moving` stay where they are. Then drops observations that the
/// noise does not explain, and landmarks left with none.
/// @param moving positions of keyframes, each once
void adjust(LandmarkGraph& graph, std::span<const std::uint32_t> moving,
            const AdjustmentOptions& options = {});

/// The same for some landmarks while all keyframes stay where they are: each on its own, by
/// Gauss-Newton. Drops nothing.
void adjust_landmarks(LandmarkGraph& graph, std::span<const LandmarkIndex> landmarks);

/// Drops observations that the noise does not explain, sets depths aside that it does not, and removes
/// landmarks that are left with nothing.
void drop_outliers(LandmarkGraph& graph, std::span<const LandmarkIndex> landmarks);

}  // namespace cairn
