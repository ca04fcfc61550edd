// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "cairn/map/landmark_map.hpp"

namespace cairn {

/// Standard deviations of a map's measurements.
struct MeasurementNoise {
  double pixel_px = 1.0;  ///< of u and of v, at octave 0; positive
  /// Ratio of the pixel sizes of consecutive octaves; at least 1.
  double octave_scale = 1.2;
  /// Of depth z: floor + quadratic·z², in the map's unit. Positive; not negative.
  double depth_floor = 0.001;
  double depth_quadratic = 0.002;

  /// @throws Error (misuse) naming the field
  void validate() const;
  double sigma_px(std::int32_t octave) const;
  double sigma_depth(double depth) const { return depth_floor + depth_quadratic * depth * depth; }
};

/// An observation as used in the adjustment.
struct Measurement {
  FrameIndex frame;
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();
  double sigma_px = 1.0;
  /// Along the optical axis. Only for a map in metres, because the noise of depths in a free unit is
  /// unknown.
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

/// Noise that explains the residuals of an adjusted map, from their medians, corrected for the fitted
/// parameters; robust to a fifth of wrong observations. For depths, scales floor and quadratic part alike.
/// Values with too few measurements stay as given.
/// @throws Error as measurements_of
MeasurementNoise estimated_noise(const LandmarkMap& map, const MeasurementNoise& start = {});

}  // namespace cairn
