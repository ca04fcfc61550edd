// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "cairn/core/execution.hpp"
#include "cairn/simulation/detail/paintings.hpp"
#include "cairn/simulation/scene.hpp"

namespace cairn::detail {

/// Builds a scene object by object. In an object's frame x points right, y to the back and z up; its front
/// faces -y.
class SceneBuilder {
 public:
  using Painting = void (Painter::*)();

  /// @param texture_scale factor on the resolution of all textures
  explicit SceneBuilder(double texture_scale) : texture_scale_(texture_scale) {}

  /// Adds a texture, which build() will paint.
  /// @param painting null: only the background
  /// @return its index in the scene's textures
  std::uint32_t paint(double width_m, double height_m, double texels_per_metre,
                      const Paint& background, Painting painting, Random random);

  /// Starts an object, to which all surfaces added next belong.
  void begin_object(std::string name, const Rigid3& world_from_object, bool movable = false,
                    bool moved = false);
  /// @param origin,edge_u,edge_v in the object's frame
  void panel(const Eigen::Vector3d& origin, const Eigen::Vector3d& edge_u,
             const Eigen::Vector3d& edge_v, std::uint32_t texture, bool emits_light = false,
             std::vector<std::array<double, 2>> outline = {});
  /// Textures of the six sides of a box.
  struct Skin {
    std::uint32_t front = 0, back = 0, left = 0, right = 0, top = 0, bottom = 0;
    static Skin all(std::uint32_t texture);
  };
  /// @param low the corner with the smallest coordinates
  void box(const Eigen::Vector3d& low, const Eigen::Vector3d& size, const Skin& skin);
  /// An upright cylinder or cone; texture `side` is wrapped once around it.
  void cylinder(const Eigen::Vector3d& foot, double radius, double top_radius, double height,
                std::uint32_t side, std::uint32_t top, int sides = 14);
  void light(const AreaLight& light) { scene_.lights.push_back(light); }
  void ambient(double brightness) { scene_.ambient = brightness; }

  /// Paints the textures and returns the scene. Call once.
  Scene build(const Executor& executor);

 private:
  struct TextureJob {
    double width_m, height_m, texels_per_metre;
    Paint background;
    Painting painting;
    Random random;
  };
  double texture_scale_;
  std::vector<TextureJob> jobs_;
  Scene scene_;
};

}  // namespace cairn::detail
