// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "cairn/core/executor.hpp"
#include "cairn/core/option_table.hpp"
#include "cairn/geometry/trajectory.hpp"
#include "cairn/map/camera.hpp"
#include "cairn/simulation/renderer.hpp"
#include "cairn/simulation/sensor.hpp"

namespace cairn {

/// 640 x 480 pixels, focal length 525 pixels, no distortion.
Camera default_simulated_camera();

struct SimulatorOptions {
  Camera camera = default_simulated_camera();
  SensorOptions sensor;
  RendererOptions renderer;
  double shutter_s = 0.0;        ///< exposure time, which causes motion blur; 0 to 1
  std::size_t blur_samples = 5;  ///< images averaged for motion blur; 2 to 100
  /// Readout time of a rolling shutter, from the first row of the colour and depth images to the last,
  /// seconds. A frame's time is that of its middle row. 0 to 1.
  double readout_s = 0.0;
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
  std::vector<std::uint8_t> bgr;     ///< 8-bit blue, green, red
  std::vector<float> depth_m;        ///< as measured; 0 if there is no reading
  std::vector<float> exact_depth_m;  ///< 0 if no surface is hit
};

/// Simulates an RGB-D camera on a path through a scene, frame by frame.
class RgbdSimulator {
 public:
  /// @throws Error (misuse) for options or a scene that are not valid
  RgbdSimulator(Scene scene, Trajectory trajectory, const SimulatorOptions& options = {},
                const Executor& executor = Executor());

  std::size_t frame_count() const { return trajectory_.size(); }
  const Trajectory& trajectory() const { return trajectory_; }
  const Scene& scene() const { return renderer_.scene(); }

  /// A frame depends only on the options and its number, so frames may be made in any order and
  /// concurrently. Thread-safe.
  /// @throws Error (misuse) if there is no such frame
  RgbdFrame frame(std::size_t index, const Executor& executor = Executor()) const;

 private:
  RenderedFrame picture_at(double timestamp_s, const Executor& executor) const;

  SimulatorOptions options_;
  Trajectory trajectory_;
  RayTable rays_;
  Renderer renderer_;
};

}  // namespace cairn
