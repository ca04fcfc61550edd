// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/placement/sight.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

#include "cairn/geometry/moved_points.hpp"

namespace cairn {
namespace {

constexpr std::ptrdiff_t kCells = 180;  // along an edge of the map of directions: 1.1 degrees each
// Relative to a distance. Between the two nothing is said: surfaces slant, and cells have a width.
constexpr float kAgrees = 0.04F;
constexpr float kContradicts = 0.10F;

// Cell of a direction under the octahedral map, which unfolds the sphere to a square with cells of
// about equal size (Cigolle et al. 2014).
std::array<std::ptrdiff_t, 2> cell_of(const Eigen::Vector3d& direction) {
  const double norm = direction.lpNorm<1>();
  double u = direction.x() / norm;
  double v = direction.y() / norm;
  if (direction.z() < 0.0) {
    const double folded = (1.0 - std::abs(v)) * (u < 0.0 ? -1.0 : 1.0);
    v = (1.0 - std::abs(u)) * (v < 0.0 ? -1.0 : 1.0);
    u = folded;
  }
  const auto index = [](double x) {
    return std::clamp<std::ptrdiff_t>(static_cast<std::ptrdiff_t>(0.5 * (x + 1.0) * kCells), 0,
                                      kCells - 1);
  };
  return {index(u), index(v)};
}

}  // namespace

SightCounts& SightCounts::operator+=(const SightCounts& other) {
  agree += other.agree;
  in_front += other.in_front;
  behind += other.behind;
  return *this;
}

SightChecker::SightChecker(const CentredPair& pair, std::size_t sample)
    : pair_(pair),
      sample_(sample),
      source_views_(seen_by(pair.source())),
      target_views_(seen_by(pair.target())) {}

std::vector<SightChecker::Seen> SightChecker::seen_by(const LandmarkCloud& cloud) {
  std::vector<Seen> views;
  for (const LandmarkView& view : cloud.views) {
    Seen& seen = views.emplace_back(Seen{view.centre, std::vector<float>(kCells * kCells, 0.0F),
                                         std::vector<float>(kCells * kCells, 0.0F)});
    for (const std::uint32_t landmark : view.landmarks) {
      const Eigen::Vector3d ray = cloud.positions[landmark] - view.centre;
      const auto distance = static_cast<float>(ray.norm());
      if (!(distance > 0.0F)) continue;
      const auto [u, v] = cell_of(ray);
      const auto cell = static_cast<std::size_t>(v * kCells + u);
      float& least = seen.least[cell];
      least = least > 0.0F ? std::min(least, distance) : distance;
      seen.greatest[cell] = std::max(seen.greatest[cell], distance);
    }
  }
  return views;
}

SightCounts SightChecker::count(const std::vector<Seen>& views,
                                std::span<const Eigen::Vector3d> landmarks) {
  SightCounts counts;
  for (const Seen& view : views) {
    for (const Eigen::Vector3d& landmark : landmarks) {
      const Eigen::Vector3d ray = landmark - view.centre;
      const auto distance = static_cast<float>(ray.norm());
      if (!(distance > 0.0F)) continue;
      const auto [u, v] = cell_of(ray);
      const auto cell = static_cast<std::size_t>(v * kCells + u);
      const float least = view.least[cell];
      if (!(least > 0.0F)) continue;
      const float greatest = view.greatest[cell];
      if (distance < least * (1.0F - kContradicts)) {
        ++counts.in_front;
      } else if (distance > greatest * (1.0F + kContradicts)) {
        ++counts.behind;
      } else if (distance >= least * (1.0F - kAgrees) && distance <= greatest * (1.0F + kAgrees)) {
        ++counts.agree;
      }
    }
  }
  return counts;
}

SightCounts SightChecker::operator()(const Similarity3& pose) const {
  const auto sample = [this](const LandmarkCloud& cloud) {
    return std::span(cloud.positions).first(std::min(sample_, cloud.size()));
  };
  SightCounts counts = count(target_views_, moved_points(sample(pair_.source()), pose));
  counts += count(source_views_, moved_points(sample(pair_.target()), pose.inverse()));
  return counts;
}

}  // namespace cairn
