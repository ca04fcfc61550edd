// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "cairn/odometry/landmark_graph.hpp"

namespace cairn {

/// How noisy the measurements of an adjusted map really are, from their residuals (a posteriori
/// variance components): the medians of the squared residuals against those of chi² distributions,
/// which wrong matches do not move. Each component stays within a factor of four of the sensor's own,
/// and stays as it is where fewer than 200 residuals tell of it. Knows no ground truth.
SensorNoise estimated_noise(const LandmarkGraph& graph);

}  // namespace cairn
