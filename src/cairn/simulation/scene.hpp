// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "cairn/geometry/rigid3.hpp"

namespace cairn {

/// Image of a surface with its mip levels, which prevent flicker of distant surfaces. Each level is
/// half the size of the previous one.
///
/// Texels are 0x00RRGGBB, 8 bits per channel, row by row from the top left.
class Texture {
 public:
  /// @param texels width * height values
  /// @throws Error (misuse) for another number of texels, or a side of 0 or more than 8192
  Texture(std::uint32_t width, std::uint32_t height, std::vector<std::uint32_t> texels);

  std::uint32_t width() const { return levels_.front().width; }
  std::uint32_t height() const { return levels_.front().height; }
  std::size_t levels() const { return levels_.size(); }
  const std::vector<std::uint32_t>& texels() const { return levels_.front().texels; }

  /// Colour at a point: bilinear between texels, linear between mip levels. Points outside the
  /// texture get the colour of the border.
  /// @param u,v   texel coordinates in level 0 from the top left; the first centre is 0.5
  /// @param level mip level, fractional; clamped to the existing levels
  std::uint32_t sample(float u, float v, float level) const;

 private:
  struct Level {
    std::uint32_t width = 0;
    std::uint32_t height = 0;
    float scale_u = 1.0F;  // from level 0; not exactly 2^-n, because sizes are rounded down
    float scale_v = 1.0F;
    std::vector<std::uint32_t> texels;
  };
  static std::uint32_t bilinear(const Level& level, float u, float v);

  std::vector<Level> levels_;
};

/// A flat part of a scene with a texture. Its points are origin + s·edge_u + t·edge_v, s and t in [0, 1];
/// seen from the front, s increases to the right and t downwards.
struct Surface {
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();  ///< world frame, metres
  Eigen::Vector3d edge_u = Eigen::Vector3d::UnitX();
  Eigen::Vector3d edge_v = Eigen::Vector3d::UnitY();  ///< orthogonal to edge_u
  /// Corners (s, t) of a convex outline, in order; empty: the whole rectangle.
  std::vector<std::array<double, 2>> outline;
  std::uint32_t texture = 0;  ///< index in Scene::textures
  /// The part of the texture that covers the rectangle: left, top, right, bottom, each in [0, 1].
  std::array<double, 4> region = {0.0, 0.0, 1.0, 1.0};
  std::uint32_t object = 0;  ///< index in Scene::objects
  bool emits_light = false;  ///< a screen or a lamp: not darkened by shade

  /// Unit normal towards the front, world frame.
  Eigen::Vector3d normal() const { return edge_v.cross(edge_u).normalized(); }
  Eigen::Vector3d point(double s, double t) const { return origin + s * edge_u + t * edge_v; }
  /// Corners in the world frame.
  std::vector<Eigen::Vector3d> corners() const;
};

/// An object in a scene.
struct SceneObject {
  std::string name;          ///< kind, e.g. "cup"
  Rigid3 world_from_object;  ///< its pose
  bool movable = false;      ///< may be moved in another session
  bool moved = false;        ///< its pose differs from the unchanged scene
};

/// A rectangular light on or below the ceiling that shines downwards.
struct AreaLight {
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  double width_m = 0.6;   ///< along x
  double length_m = 0.6;  ///< along y
  double power = 1.0;     ///< brightness of a white surface 1 m below a small light
};

/// All visible content. The world's z axis points up.
struct Scene {
  std::vector<Texture> textures;
  std::vector<SceneObject> objects;
  std::vector<Surface> surfaces;
  std::vector<AreaLight> lights;
  double ambient = 0.5;  ///< brightness of an unobstructed white surface, without the lights

  /// @throws Error (misuse) naming the surface and its defect: a missing texture or object, no area, edges
  ///        that are not orthogonal, an outline with fewer than 3 corners
  void validate() const;

  /// Distance in metres from a point to the nearest surface; infinite in an empty scene.
  double distance(const Eigen::Vector3d& point) const;
};

}  // namespace cairn
