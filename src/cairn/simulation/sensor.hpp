// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <numbers>
#include <vector>

#include "cairn/core/executor.hpp"
#include "cairn/simulation/renderer.hpp"

namespace cairn {

/// What a real RGB-D camera makes of an ideal picture.
///
/// Depth follows the structured-light sensor of the first Kinect. It measures disparity, that is
/// inverse depth, with noise and in steps, so both its deviation and its resolution in depth grow with
/// the square of the depth: sigma = depth_noise·z², step = depth_step·z² (Khoshelham and Elberink,
/// "Accuracy and Resolution of Kinect Depth Data for Indoor Mapping Applications", Sensors 2012, 12:
/// a deviation of 1.425 mm and a resolution of 2.85 mm at 1 m). It has no reading
/// - nearer or farther than its range,
/// - where the projector's light does not reach what the camera sees: beside the edges of near things,
///   on the side away from the projector, as wide as baseline and depths make it,
/// - at the edges of things, in half of the pixels,
/// - where the surface is seen under too flat an angle, and
/// - here and there for no reason.
struct SensorOptions {
  double exposure = 1.0;            ///< factor on the light, before clipping at white; 0.01 to 100
  double color_noise = 2.0;         ///< standard deviation of each channel, grey levels; 0 to 100
  bool ideal_depth = false;         ///< exact depth without noise, steps and holes
  double depth_noise_m = 1.425e-3;  ///< standard deviation at 1 m, steps included; 0 to 0.1
  double depth_step_m = 2.85e-3;    ///< resolution at 1 m; 0: none; 0 to 0.1
  double min_depth_m = 0.4;         ///< 0 or more
  double max_depth_m = 6.0;         ///< more than min_depth_m
  double baseline_m = 0.075;        ///< of the projector, to the right of the camera; 0: no shadow
  /// Largest angle of the line of sight against the surface's normal, radians; 0 to pi/2.
  double max_incidence_rad = 80.0 * std::numbers::pi / 180.0;
  double edge_holes = 0.5;  ///< share of the pixels at edges without a reading; 0 to 1
  double dropout = 0.001;   ///< share of all pixels without a reading; 0 to 1

  /// @throws Error (misuse) naming the field
  void validate() const;
};

/// The colour image, 8-bit blue, green, red.
/// @param stream of the random numbers: same stream, same noise
std::vector<std::uint8_t> expose(const RenderedFrame& frame, const SensorOptions& options,
                                 std::uint64_t stream, const Executor& executor = Executor());

/// The depth image, metres, 0 where there is no reading.
/// @param focal_length_px of the camera, horizontally: how wide the projector's shadows are
std::vector<float> measure_depth(const RenderedFrame& frame, double focal_length_px,
                                 const SensorOptions& options, std::uint64_t stream,
                                 const Executor& executor = Executor());

}  // namespace cairn
