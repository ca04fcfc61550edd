// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "cairn/core/execution.hpp"
#include "cairn/geometry/rigid3.hpp"
#include "cairn/map/camera.hpp"
#include "cairn/simulation/scene.hpp"
#include "cairn/simulation/simulator.hpp"

namespace cairn::detail {

/// Image of an ideal camera, without noise or limits. Row by row from the top left.
struct RenderedFrame {
  std::uint32_t width = 0;
  std::uint32_t height = 0;
  /// Blue, green, red of each pixel, kLightPerLevel units per grey level of an 8-bit image. May exceed
  /// white (255 levels).
  std::vector<std::uint16_t> bgr;
  /// Depth along the optical axis, metres; 0 if no surface is hit.
  std::vector<float> depth_m;
  /// Cosine of the angle between the line of sight and the surface's normal; 0 if no surface is hit.
  std::vector<float> facing;

  static constexpr int kLightPerLevel = 64;
};

/// A line of sight for each pixel of a camera: the (x, y, 1) in camera coordinates, x right, y down, z
/// forward, for which (x·z, y·z, z) projects to the pixel's centre.
struct RayTable {
  std::vector<float> x;
  std::vector<float> y;
};

/// Inverts the camera's projection, including distortion, to 1e-9 of the image plane.
/// @throws Error (misuse) for a defective camera, or naming a pixel where its distortion cannot be inverted
RayTable ray_table(const Camera& camera);

/// Renders a scene by casting a ray through each pixel (Embree). Precomputes the light: from the lights,
/// with soft shadows, and from the surroundings, darker in corners; surfaces are matt. The image is the
/// same for any number of threads. Other processors may round differently: depth then agrees to a relative
/// 1e-6, and a pixel on an edge may differ.
class Renderer {
 public:
  /// @param light_grid_m, smooth_edges see SimulatorOptions
  /// @throws Error (misuse) for a scene that is not valid
  Renderer(Scene scene, double light_grid_m, bool smooth_edges,
           const Executor& executor = Executor());

  const Scene& scene() const;

  /// Thread-safe.
  /// @param rays the camera's ray_table
  RenderedFrame render(const Camera& camera, const RayTable& rays, const Rigid3& world_from_camera,
                       const Executor& executor = Executor()) const;

 private:
  struct State;
  std::shared_ptr<const State> state_;
};

}  // namespace cairn::detail
