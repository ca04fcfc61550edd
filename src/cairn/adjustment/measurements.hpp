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

/// How far the measurements of a map are off, as standard deviations.
struct MeasurementNoise {
  double pixel_px = 1.0;  ///< of u and of v, at octave 0; positive
  /// By how much a pixel of an octave is larger than one of the octave below; at least 1.
  double octave_scale = 1.2;
  /// Of depth z: floor + quadratic·z², in the map's unit. Positive; not negative.
  double depth_floor = 0.001;
  double depth_quadratic = 0.002;

  /// @throws Error (misuse) naming the field
  void validate() const;
  double sigma_px(std::int32_t octave) const;
  double sigma_depth(double depth) const { return depth_floor + depth_quadratic * depth * depth; }
};

/// An observation as it is adjusted.
struct Measurement {
  FrameIndex frame;
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();
  double sigma_px = 1.0;
  /// Along the optical axis. Of a map in metres only: where the unit is free, depths do not say how far
  /// off they are.
  std::optional<double> depth;
  double sigma_depth = 1.0;
};

/// Why the observations of a map cannot be adjusted: it does not know them, or a frame that observes has no
/// camera; empty if they can.
std::string measurement_defect(const LandmarkMap& map);

/// Observations that can be adjusted: by landmark, in the map's order; without those whose landmark is not
/// in front of the camera, and of several by one frame the first only.
/// @throws Error (input) for a map with a measurement_defect()
std::vector<std::vector<Measurement>> measurements_of(const LandmarkMap& map,
                                                      const MeasurementNoise& noise);

/// Squared residuals (pixel; depth, 0 if not measured) over the variances.
struct SquaredResiduals {
  double pixel = 0.0;
  double depth = 0.0;
};

/// std::nullopt if the point is not in front of the camera.
std::optional<SquaredResiduals> squared_residuals(const LandmarkMap& map,
                                                  const Measurement& measurement,
                                                  const Eigen::Vector3d& x_in_world);

/// The noise by which the residuals of an adjusted map are as large as they should be: from their medians,
/// which a fifth of wrong observations hardly moves, with allowance for what was fitted. Of depths, the floor
/// and the quadratic part are multiplied alike. What is measured too seldom to tell stays as given.
/// @throws Error as measurements_of
MeasurementNoise estimated_noise(const LandmarkMap& map, const MeasurementNoise& start = {});

}  // namespace cairn
