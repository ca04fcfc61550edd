// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <numbers>
#include <vector>

#include "cairn/core/execution.hpp"
#include "cairn/core/option_table.hpp"
#include "cairn/geometry/trajectory.hpp"
#include "cairn/map/camera.hpp"
#include "cairn/simulation/scene.hpp"

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

/// 640 x 480 pixels, focal length 525 pixels, no distortion.
Camera default_simulated_camera();

struct SimulatorOptions {
  Camera camera = default_simulated_camera();
  SensorOptions sensor;
  /// Grid of the precomputed light on each surface, metres; 0.01 to 1.
  double light_grid_m = 0.08;
  /// Averages four lines of sight in pixels with an edge; if false, each pixel uses its centre.
  bool smooth_edges = true;
  double shutter_s = 0.0;        ///< exposure time, which causes motion blur; 0 to 1
  std::size_t blur_samples = 5;  ///< images averaged for motion blur; 2 to 100
  /// Readout time of a rolling shutter, from the first row of the colour and depth images to the last,
  /// seconds. A frame's time is that of its middle row. 0 to 1.
  double readout_s = 0.0;
  /// From the camera to a second one on its right, of a rectified stereo pair that replaces the depth sensor, metres;
  /// 0: none. 0 to 10.
  double stereo_baseline_m = 0.0;
  std::uint64_t seed = 1;  ///< of the sensor's noise

  static const OptionTable table;
  /// @throws Error (misuse) naming the field
  void validate() const;
};

/// Seeds of the differences between sessions of one place.
struct SessionSeeds {
  std::uint64_t path = 0;
  std::uint64_t noise = 0;
};

/// @param seed of the place
SessionSeeds session_seeds(std::uint64_t seed, std::uint64_t session);

/// One frame of a simulated sequence; row by row from the top left.
struct RgbdFrame {
  double timestamp_s = 0.0;
  Rigid3 world_from_camera;  ///< exact, at the middle of the exposure of the middle row
  std::uint32_t width = 0;
  std::uint32_t height = 0;
  std::vector<std::uint8_t> bgr;  ///< 8-bit blue, green, red
  std::vector<float> depth_m;     ///< as measured; 0 if there is no reading; empty of a stereo pair
  std::vector<std::uint8_t> right_bgr;  ///< of the right camera of a stereo pair, else empty
  std::vector<float> exact_depth_m;     ///< 0 if no surface is hit
};

/// Simulates an RGB-D or stereo camera on a path through a scene, frame by frame.
class RgbdSimulator {
 public:
  /// @throws Error (misuse) for options or a scene that are not valid
  RgbdSimulator(Scene scene, Trajectory trajectory, const SimulatorOptions& options = {},
                const Executor& executor = Executor());

  std::size_t frame_count() const { return trajectory_.size(); }
  const Trajectory& trajectory() const { return trajectory_; }
  const Scene& scene() const;

  /// A frame depends only on the options and its number, so frames may be made in any order and
  /// concurrently. Thread-safe.
  /// @throws Error (misuse) if there is no such frame
  RgbdFrame frame(std::size_t index, const Executor& executor = Executor()) const;

 private:
  struct Optics;

  SimulatorOptions options_;
  Trajectory trajectory_;
  std::shared_ptr<const Optics> optics_;
};

}  // namespace cairn
