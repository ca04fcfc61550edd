// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "cairn/vision/detail/landmark_graph.hpp"

namespace cairn::detail {

/// Measurement noise of an adjusted map, estimated from its residuals (a posteriori variance components):
/// medians of the squared residuals relative to those of chi² distributions, robust to wrong matches. Each
/// component stays within a factor of four of the sensor's, and unchanged with fewer than 200 residuals.
/// Uses no ground truth.
SensorNoise estimated_noise(const LandmarkGraph& graph);

}  // namespace cairn::detail
