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
/// Depth follows the structured-light sensor of the first Kinect, which measures disparity (inverse
/// depth) with noise and quantisation. Standard deviation and step of the depth z therefore grow
/// with z²: depth_noise_m·z² and depth_step_m·z². At 1 m, these are 1.425 mm and 2.85 mm
/// (Khoshelham and Elberink, "Accuracy and Resolution of Kinect Depth Data for Indoor Mapping
/// Applications", Sensors 12, 2012). These pixels have no reading:
/// - pixels with a depth outside the range,
/// - the projector's shadow beside near objects, on the side away from the projector; its width
///   depends on baseline and depths,
/// - a share of the pixels at object edges,
/// - pixels with too large an angle of incidence, and
/// - random pixels.
struct SensorOptions {
  double exposure = 1.0;            ///< factor on the light, before clipping at white; 0.01 to 100
  double color_noise = 2.0;         ///< standard deviation per channel, grey levels; 0 to 100
  bool ideal_depth = false;         ///< exact depth without noise, quantisation and holes
  double depth_noise_m = 1.425e-3;  ///< standard deviation at 1 m, quantisation included; 0 to 0.1
  double depth_step_m = 2.85e-3;    ///< quantisation step at 1 m; 0: none; 0 to 0.1
  double min_depth_m = 0.4;         ///< least measured depth; 0 or more
  double max_depth_m = 6.0;         ///< largest measured depth; more than min_depth_m
  double baseline_m = 0.075;        ///< from the camera to the projector on its right; 0: no shadow
  /// Largest angle between the line of sight and the surface normal, radians; 0 to pi/2.
  double max_incidence_rad = 80.0 * std::numbers::pi / 180.0;
  double edge_holes = 0.5;  ///< share of edge pixels without a reading; 0 to 1
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
  /// Grid spacing of the precomputed light on each surface, metres; 0.01 to 1.
  double light_grid_m = 0.08;
  /// Averages four rays in each pixel with an edge; if false, each pixel uses its central ray.
  bool smooth_edges = true;
  double shutter_s = 0.0;        ///< exposure time, which causes motion blur; 0 to 1
  std::size_t blur_samples = 5;  ///< images averaged for motion blur; 2 to 100
  /// Readout time of a rolling shutter, from the first row of the colour and depth images to the
  /// last, seconds; 0 to 1. A frame's timestamp is the time of its middle row.
  double readout_s = 0.0;
  /// Baseline of a rectified stereo pair, metres; 0 to 10. The pair adds a camera on the right and
  /// has no depth sensor. 0: depth sensor.
  double stereo_baseline_m = 0.0;
  std::uint64_t seed = 1;  ///< seed of the sensor noise

  static const OptionTable table;
  /// @throws Error (misuse) naming the field
  void validate() const;
};

/// Seeds that differ between sessions of one place.
struct SessionSeeds {
  std::uint64_t path = 0;
  std::uint64_t noise = 0;
};

/// @param seed seed of the place
SessionSeeds session_seeds(std::uint64_t seed, std::uint64_t session);

/// One frame of a simulated sequence; images are row by row from the top left.
struct RgbdFrame {
  double timestamp_s = 0.0;
  Rigid3 world_from_camera;  ///< exact, at the middle of the exposure of the middle row
  std::uint32_t width = 0;
  std::uint32_t height = 0;
  std::vector<std::uint8_t> bgr;        ///< 8-bit blue, green, red
  std::vector<float> depth_m;           ///< measured depth; 0: no reading; empty for a stereo pair
  std::vector<std::uint8_t> right_bgr;  ///< right image of a stereo pair, else empty
  std::vector<float> exact_depth_m;     ///< 0 if the ray hits no surface
};

/// Simulates an RGB-D or stereo camera on a path through a scene, frame by frame.
class RgbdSimulator {
 public:
  /// @throws Error (misuse) for invalid options or an invalid scene
  RgbdSimulator(Scene scene, Trajectory trajectory, const SimulatorOptions& options = {},
                const Executor& executor = Executor());

  std::size_t frame_count() const { return trajectory_.size(); }
  const Trajectory& trajectory() const { return trajectory_; }
  const Scene& scene() const;

  /// Renders a frame. The frame depends only on scene, trajectory, options and index; frames may be
  /// rendered in any order. Thread-safe.
  /// @throws Error (misuse) for an index out of range
  RgbdFrame frame(std::size_t index, const Executor& executor = Executor()) const;

 private:
  struct Optics;

  SimulatorOptions options_;
  Trajectory trajectory_;
  std::shared_ptr<const Optics> optics_;
};

}  // namespace cairn
