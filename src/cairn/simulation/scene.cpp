// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/simulation/scene.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include <fmt/format.h>

#include "cairn/core/error.hpp"

namespace cairn {
namespace {

// Two channels at a time: in a word 0x00RR00BB each has eight bits of room above it.
constexpr std::uint32_t kEven = 0x00ff00ffU;

// a + (b - a) * weight / 256, each channel.
std::uint32_t blend(std::uint32_t a, std::uint32_t b, std::uint32_t weight) {
  const std::uint32_t keep = 256 - weight;
  const std::uint32_t even = ((a & kEven) * keep + (b & kEven) * weight) >> 8;
  const std::uint32_t odd = ((a >> 8) & kEven) * keep + ((b >> 8) & kEven) * weight;
  return (even & kEven) | (odd & ~kEven);
}

std::uint32_t average(std::uint32_t a, std::uint32_t b, std::uint32_t c, std::uint32_t d) {
  std::uint32_t result = 0;
  for (const int shift : {0, 8, 16}) {
    const auto channel = [&](std::uint32_t texel) { return (texel >> shift) & 0xffU; };
    result |= ((channel(a) + channel(b) + channel(c) + channel(d) + 2) / 4) << shift;
  }
  return result;
}

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

Texture::Texture(std::uint32_t width, std::uint32_t height, std::vector<std::uint32_t> texels) {
  constexpr std::uint32_t kLargest = 8192;
  if (width == 0 || height == 0 || width > kLargest || height > kLargest ||
      texels.size() != std::size_t{width} * height) {
    throw Error(ErrorKind::kMisuse, "Texture",
                fmt::format("{} texels for {} x {}", texels.size(), width, height),
                "sides of 1 to 8192 and as many texels");
  }
  levels_.push_back({width, height, 1.0F, 1.0F, std::move(texels)});
  while (levels_.back().width > 1 || levels_.back().height > 1) {
    const Level& from = levels_.back();
    Level to{std::max(1U, from.width / 2), std::max(1U, from.height / 2), 1.0F, 1.0F, {}};
    to.scale_u = static_cast<float>(to.width) / static_cast<float>(width);
    to.scale_v = static_cast<float>(to.height) / static_cast<float>(height);
    to.texels.resize(std::size_t{to.width} * to.height);
    for (std::uint32_t y = 0; y < to.height; ++y) {
      const std::size_t row0 = std::size_t{std::min(2 * y, from.height - 1)} * from.width;
      const std::size_t row1 = std::size_t{std::min(2 * y + 1, from.height - 1)} * from.width;
      for (std::uint32_t x = 0; x < to.width; ++x) {
        const std::uint32_t x0 = std::min(2 * x, from.width - 1);
        const std::uint32_t x1 = std::min(2 * x + 1, from.width - 1);
        to.texels[std::size_t{y} * to.width + x] =
            average(from.texels[row0 + x0], from.texels[row0 + x1], from.texels[row1 + x0],
                    from.texels[row1 + x1]);
      }
    }
    levels_.push_back(std::move(to));
  }
}

std::uint32_t Texture::bilinear(const Level& level, float u, float v) {
  // In 1/256 of a texel, clamped to the centres of the border's texels.
  const auto fixed = [](float x, std::uint32_t size) {
    const auto most = static_cast<std::int32_t>((size - 1) << 8);
    const float inside = std::clamp(x * 256.0F - 128.0F, -1e6F, 1e8F);
    return static_cast<std::uint32_t>(std::clamp(static_cast<std::int32_t>(inside), 0, most));
  };
  const std::uint32_t x = fixed(u * level.scale_u, level.width);
  const std::uint32_t y = fixed(v * level.scale_v, level.height);
  const std::size_t right = (x >> 8) + 1 < level.width ? 1 : 0;
  const std::size_t below = (y >> 8) + 1 < level.height ? level.width : 0;
  const std::uint32_t* const texel =
      level.texels.data() + std::size_t{y >> 8} * level.width + (x >> 8);
  return blend(blend(texel[0], texel[right], x & 0xffU),
               blend(texel[below], texel[below + right], x & 0xffU), y & 0xffU);
}

std::uint32_t Texture::sample(float u, float v, float level) const {
  const auto last = static_cast<float>(levels_.size() - 1);
  const float clamped = std::clamp(level, 0.0F, last);
  const auto lower = static_cast<std::size_t>(clamped);
  // One level alone serves for a quarter of the way on either side: half the cost for half the
  // surfaces.
  const auto weight =
      static_cast<std::int32_t>((clamped - static_cast<float>(lower)) * 512.0F) - 128;
  if (weight <= 0) return bilinear(levels_[lower], u, v);
  if (weight >= 256) return bilinear(levels_[lower + 1], u, v);
  return blend(bilinear(levels_[lower], u, v), bilinear(levels_[lower + 1], u, v),
               static_cast<std::uint32_t>(weight));
}

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
