// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/simulation/scene.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include "cairn/core/error.hpp"

namespace cairn {
namespace {

double squared_distance_to_segment(const Eigen::Vector3d& point, const Eigen::Vector3d& a,
                                   const Eigen::Vector3d& b) {
  const Eigen::Vector3d along = b - a;
  const double share =
      std::clamp((point - a).dot(along) / std::max(along.squaredNorm(), 1e-30), 0.0, 1.0);
  return (a + share * along - point).squaredNorm();
}

double squared_distance_to_surface(const Eigen::Vector3d& point, const Surface& surface) {
  const std::vector<Eigen::Vector3d> corners = surface.corners();
  const Eigen::Vector3d normal = surface.normal();
  const double height = normal.dot(point - surface.origin);
  // The outline is convex: its foot is inside if it is on one side of all edges.
  bool left = false;
  bool right = false;
  double nearest = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < corners.size(); ++i) {
    const Eigen::Vector3d& a = corners[i];
    const Eigen::Vector3d& b = corners[(i + 1) % corners.size()];
    const double side = normal.dot((b - a).cross(point - a));
    left = left || side > 0.0;
    right = right || side < 0.0;
    nearest = std::min(nearest, squared_distance_to_segment(point, a, b));
  }
  return left && right ? nearest : height * height;
}

}  // namespace

std::vector<Eigen::Vector3d> Surface::corners() const {
  if (outline.empty()) return {point(0, 0), point(1, 0), point(1, 1), point(0, 1)};
  std::vector<Eigen::Vector3d> result;
  result.reserve(outline.size());
  for (const auto& [s, t] : outline) result.push_back(point(s, t));
  return result;
}

void Scene::validate() const {
  for (std::size_t i = 0; i < surfaces.size(); ++i) {
    const Surface& surface = surfaces[i];
    const auto refuse = [&](std::string_view what) {
      throw Error(ErrorKind::kMisuse, fmt::format("Scene.surfaces[{}]", i), what, "a flat piece");
    };
    if (surface.texture >= textures.size()) refuse("no such texture");
    if (surface.object >= objects.size()) refuse("no such object");
    const double u = surface.edge_u.norm();
    const double v = surface.edge_v.norm();
    constexpr double kShortest = 1e-6;
    const bool has_area =
        u > kShortest && v > kShortest && std::isfinite(u + v + surface.origin.sum());
    if (!has_area) refuse("no area");
    constexpr double kSkew = 1e-6;
    if (std::abs(surface.edge_u.dot(surface.edge_v)) > kSkew * u * v) {
      refuse("edges not at a right angle");
    }
    if (!surface.outline.empty() && surface.outline.size() < 3) refuse("an outline of 2 corners");
  }
}

double Scene::distance(const Eigen::Vector3d& point) const {
  double nearest = std::numeric_limits<double>::infinity();
  for (const Surface& surface : surfaces) {
    // The sphere around the rectangle rules out most surfaces at once.
    const Eigen::Vector3d centre = surface.point(0.5, 0.5);
    const double radius = 0.5 * (surface.edge_u + surface.edge_v).norm();
    const double reach = nearest + radius;
    if ((point - centre).squaredNorm() > reach * reach) continue;
    nearest = std::min(nearest, std::sqrt(squared_distance_to_surface(point, surface)));
  }
  return nearest;
}

}  // namespace cairn
