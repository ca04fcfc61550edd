// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/alignment/detail/evidence/seen_views.hpp"

#include <algorithm>
#include <cmath>

namespace cairn::detail {
namespace {

// Cells along an edge of the map of directions, 1.1 degrees each. Their total number fits 16 bits.
constexpr std::ptrdiff_t kCells = 180;
// Differences of depth, relative to the distance. Between both limits, a line of sight is not counted,
// because surfaces slant and cells have a width.
constexpr float kAgrees = 0.04F;
constexpr float kContradicts = 0.10F;

// Cell of a direction under the octahedral map, which unfolds the sphere to a square with cells of
// about equal size (Cigolle et al. 2014).
std::size_t cell_of(const Eigen::Vector3d& direction) {
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
  return static_cast<std::size_t>(index(v) * kCells + index(u));
}

}  // namespace

SeenViews::SeenViews(const LandmarkCloud& cloud) {
  for (const LandmarkView& view : cloud.views) {
    View& seen = views_.emplace_back(View{
        .centre = view.centre, .slots = std::vector<std::uint16_t>(kCells * kCells), .ranges = {}});
    for (const std::uint32_t landmark : view.landmarks) {
      const Eigen::Vector3d ray = cloud.positions[landmark] - view.centre;
      const auto distance = static_cast<float>(ray.norm());
      if (!(distance > 0.0F)) continue;
      std::uint16_t& slot = seen.slots[cell_of(ray)];
      if (slot == 0) {
        seen.ranges.push_back({distance, distance});
        slot = static_cast<std::uint16_t>(seen.ranges.size());
      }
      Range& range = seen.ranges[slot - 1U];
      range.least = std::min(range.least, distance);
      range.greatest = std::max(range.greatest, distance);
    }
  }
}

SeenViews::Sight SeenViews::sight_of(const View& view, const Eigen::Vector3d& ray) {
  const auto distance = static_cast<float>(ray.norm());
  if (!(distance > 0.0F)) return nullptr;
  const std::uint16_t slot = view.slots[cell_of(ray)];
  if (slot == 0) return nullptr;
  const auto [least, greatest] = view.ranges[slot - 1U];
  if (distance < least * (1.0F - kContradicts)) return &SightCounts::in_front;
  if (distance > greatest * (1.0F + kContradicts)) return &SightCounts::behind;
  if (distance >= least * (1.0F - kAgrees) && distance <= greatest * (1.0F + kAgrees)) {
    return &SightCounts::agree;
  }
  return nullptr;
}

SightCounts SeenViews::count(std::span<const Eigen::Vector3d> landmarks) const {
  SightCounts counts;
  for (const View& view : views_) {
    for (const Eigen::Vector3d& landmark : landmarks) {
      if (const Sight sight = sight_of(view, landmark - view.centre)) ++(counts.*sight);
    }
  }
  return counts;
}

SightCounts SeenViews::count_around(const Ball& ball, std::span<const Eigen::Vector3d> landmarks,
                                    const LandmarkCloud& cloud) const {
  std::vector<SightCounts> each(landmarks.size());
  for (std::size_t v = 0; v < views_.size(); ++v) {
    const View& view = views_[v];
    std::vector<bool> into_ball(kCells * kCells, false);
    for (const std::uint32_t seen : cloud.views[v].landmarks) {
      const Eigen::Vector3d ray = cloud.positions[seen] - view.centre;
      if (ball.contains(cloud.positions[seen]) && !ray.isZero(0.0)) into_ball[cell_of(ray)] = true;
    }
    for (std::size_t i = 0; i < landmarks.size(); ++i) {
      const Eigen::Vector3d ray = landmarks[i] - view.centre;
      const Sight sight = sight_of(view, ray);
      if (sight && !into_ball[cell_of(ray)]) ++(each[i].*sight);
    }
  }
  SightCounts counts;
  for (const SightCounts& one : each) {
    if (one.total() == 0) continue;
    if (one.agree >= std::max(one.in_front, one.behind)) {
      ++counts.agree;
    } else {
      ++(one.in_front >= one.behind ? counts.in_front : counts.behind);
    }
  }
  return counts;
}

}  // namespace cairn::detail
