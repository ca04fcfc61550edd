// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <numbers>
#include <vector>

#include "cairn/core/executor.hpp"
#include "cairn/core/option_table.hpp"
#include "cairn/simulation/renderer.hpp"

namespace cairn {

/// Model of a real RGB-D camera, applied to an ideal image.
///
/// Depth follows the structured-light sensor of the first Kinect. It measures disparity, that is inverse
/// depth, with noise and quantisation, so its standard deviation and its resolution in depth grow with the
/// square of the depth: sigma = depth_noise·z², step = depth_step·z² (Khoshelham and Elberink, "Accuracy
/// and Resolution of Kinect Depth Data for Indoor Mapping Applications", Sensors 2012, 12: 1.425 mm and
/// 2.85 mm at 1 m). There is no reading
/// - nearer or farther than the range,
/// - in the projector's shadow: beside the edges of near objects, on the side away from the projector, with
///   a width from baseline and depths,
/// - at the edges of objects, in half of the pixels,
/// - at too flat an angle to the surface, and
/// - at random pixels.
struct SensorOptions {
  double exposure = 1.0;            ///< factor on the light, before clipping at white; 0.01 to 100
  double color_noise = 2.0;         ///< standard deviation of each channel, grey levels; 0 to 100
  bool ideal_depth = false;         ///< exact depth without noise, quantisation and holes
  double depth_noise_m = 1.425e-3;  ///< standard deviation at 1 m, quantisation included; 0 to 0.1
  double depth_step_m = 2.85e-3;    ///< resolution at 1 m; 0: none; 0 to 0.1
  double min_depth_m = 0.4;         ///< 0 or more
  double max_depth_m = 6.0;         ///< more than min_depth_m
  double baseline_m = 0.075;        ///< of the projector, to the right of the camera; 0: no shadow
  /// Largest angle between the line of sight and the surface's normal, radians; 0 to pi/2.
  double max_incidence_rad = 80.0 * std::numbers::pi / 180.0;
  double edge_holes = 0.5;  ///< share of the pixels at edges without a reading; 0 to 1
  double dropout = 0.001;   ///< share of all pixels without a reading; 0 to 1

  static const OptionTable table;
  /// @throws Error (misuse) naming the field
  void validate() const;
};

/// The colour image, 8-bit blue, green, red.
/// @param stream of the random numbers: the same stream gives the same noise
std::vector<std::uint8_t> expose(const RenderedFrame& frame, const SensorOptions& options,
                                 std::uint64_t stream, const Executor& executor = Executor());

/// The depth image, metres, 0 if there is no reading.
/// @param focal_length_px of the camera, horizontal; determines the width of the projector's shadows
std::vector<float> measure_depth(const RenderedFrame& frame, double focal_length_px,
                                 const SensorOptions& options, std::uint64_t stream,
                                 const Executor& executor = Executor());

}  // namespace cairn
