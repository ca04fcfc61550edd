// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/simulation/detail/scene_builder.hpp"

#include <cmath>
#include <numbers>
#include <optional>
#include <utility>

namespace cairn::detail {

std::uint32_t SceneBuilder::paint(double width_m, double height_m, double texels_per_metre,
                                  const Paint& background, Painting painting, Random random) {
  jobs_.push_back(
      {width_m, height_m, texels_per_metre * texture_scale_, background, painting, random});
  return static_cast<std::uint32_t>(jobs_.size() - 1);
}

void SceneBuilder::begin_object(std::string name, const Rigid3& world_from_object, bool movable,
                                bool moved) {
  scene_.objects.push_back({std::move(name), world_from_object, movable, moved});
}

void SceneBuilder::panel(const Eigen::Vector3d& origin, const Eigen::Vector3d& edge_u,
                         const Eigen::Vector3d& edge_v, std::uint32_t texture, bool emits_light,
                         std::vector<std::array<double, 2>> outline) {
  const Rigid3& pose = scene_.objects.back().world_from_object;
  const Eigen::Matrix3d rotation = pose.rotation();
  Surface surface;
  surface.origin = pose * origin;
  surface.edge_u = rotation * edge_u;
  surface.edge_v = rotation * edge_v;
  surface.outline = std::move(outline);
  surface.texture = texture;
  surface.object = static_cast<std::uint32_t>(scene_.objects.size() - 1);
  surface.emits_light = emits_light;
  scene_.surfaces.push_back(std::move(surface));
}

SceneBuilder::Skin SceneBuilder::Skin::all(std::uint32_t texture) {
  return {texture, texture, texture, texture, texture, texture};
}

void SceneBuilder::box(const Eigen::Vector3d& low, const Eigen::Vector3d& size, const Skin& skin) {
  const Eigen::Vector3d x(size.x(), 0, 0);
  const Eigen::Vector3d y(0, size.y(), 0);
  const Eigen::Vector3d z(0, 0, size.z());
  panel(low + z, x, -z, skin.front);
  panel(low + x + y + z, -x, -z, skin.back);
  panel(low + y + z, -y, -z, skin.left);
  panel(low + x + z, y, -z, skin.right);
  panel(low + y + z, x, -y, skin.top);
  panel(low, x, y, skin.bottom);
}

void SceneBuilder::cylinder(const Eigen::Vector3d& foot, double radius, double top_radius,
                            double height, std::uint32_t side, std::uint32_t top, int sides) {
  const auto corner = [&](double share, double r, double z) {
    const double angle = 2.0 * std::numbers::pi * share;
    return Eigen::Vector3d(foot + Eigen::Vector3d(r * std::sin(angle), -r * std::cos(angle), z));
  };
  const double widest = std::max(radius, top_radius);
  std::vector<std::array<double, 2>> circle;
  for (int i = 0; i < sides; ++i) {
    const double from = static_cast<double>(i) / sides;
    const double to = static_cast<double>(i + 1) / sides;
    const Eigen::Vector3d low_from = corner(from, radius, 0.0);
    const Eigen::Vector3d low_to = corner(to, radius, 0.0);
    const Eigen::Vector3d high_from = corner(from, top_radius, height);
    const Eigen::Vector3d high_to = corner(to, top_radius, height);
    // A trapezium in the rectangle as wide as its longer side.
    const Eigen::Vector3d middle_low = 0.5 * (low_from + low_to);
    const Eigen::Vector3d middle_high = 0.5 * (high_from + high_to);
    const Eigen::Vector3d right = (low_to - low_from + high_to - high_from).normalized();
    const double wide = 2.0 * widest * std::sin(std::numbers::pi / sides);
    const double inset_low = 0.5 - 0.5 * radius / widest;
    const double inset_high = 0.5 - 0.5 * top_radius / widest;
    panel(middle_high - 0.5 * wide * right, wide * right, middle_low - middle_high, side, false,
          {{inset_high, 0.0}, {1.0 - inset_high, 0.0}, {1.0 - inset_low, 1.0}, {inset_low, 1.0}});
    scene_.surfaces.back().region = {from, 0.0, to, 1.0};
    const double angle = 2.0 * std::numbers::pi * from;
    circle.push_back({0.5 + 0.5 * std::sin(angle), 0.5 + 0.5 * std::cos(angle)});
  }
  panel(foot + Eigen::Vector3d(-top_radius, top_radius, height),
        Eigen::Vector3d(2.0 * top_radius, 0, 0), Eigen::Vector3d(0, -2.0 * top_radius, 0), top,
        false, std::move(circle));
}

Scene SceneBuilder::build(const Executor& executor) {
  std::vector<std::optional<Texture>> painted(jobs_.size());
  executor.for_blocks(jobs_.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      TextureJob& job = jobs_[i];
      Painter painter(job.width_m, job.height_m, job.texels_per_metre, job.background, job.random);
      if (job.painting != nullptr) (painter.*job.painting)();
      painted[i] = painter.texture();
    }
  });
  for (auto& texture : painted) scene_.textures.push_back(std::move(*texture));
  jobs_.clear();
  return std::move(scene_);
}

}  // namespace cairn::detail
