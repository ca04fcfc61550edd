// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "cairn/adjustment/adjust.hpp"

namespace cairn::detail {

/// An observation as used in the adjustment.
struct Measurement {
  FrameIndex frame;
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();
  double sigma_px = 1.0;
  /// Depth along the optical axis. Only for a map in metres, because the noise of depths in a free
  /// unit is unknown.
  std::optional<double> depth;
  double sigma_depth = 1.0;
};

/// Why the observations of a map cannot be adjusted: it has none, or an observing frame has no camera;
/// empty if they can.
std::string measurement_defect(const LandmarkMap& map);

/// Observations that can be adjusted, by landmark, in the map's order. Leaves out landmarks behind the
/// camera, and all but the first observation of a landmark in one frame.
/// @throws Error (input) for a map with a measurement_defect()
std::vector<std::vector<Measurement>> measurements_of(const LandmarkMap& map,
                                                      const MeasurementNoise& noise);

/// Squared residuals (pixel; depth, 0 if not measured) divided by their variances.
struct SquaredResiduals {
  double pixel = 0.0;
  double depth = 0.0;
};

/// std::nullopt if the point is not in front of the camera.
std::optional<SquaredResiduals> squared_residuals(const LandmarkMap& map,
                                                  const Measurement& measurement,
                                                  const Eigen::Vector3d& x_in_world);

}  // namespace cairn::detail
