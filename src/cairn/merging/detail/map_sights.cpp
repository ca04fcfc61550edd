// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/merging/detail/map_sights.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace cairn::detail {
namespace {

constexpr double kBorderPx = 8.0;     // margin of the image in which a view does not count
constexpr double kCell = 0.02;        // of directions: focal lengths, about one degree
constexpr double kRangeShare = 0.04;  // by which ranges along one direction may differ

// Cells of one row follow each other.
std::int64_t cell(double x, double y) {
  constexpr std::int64_t kWide = 1 << 20;
  return static_cast<std::int64_t>(std::floor(y / kCell)) * kWide +
         static_cast<std::int64_t>(std::floor(x / kCell));
}

}  // namespace

Eigen::Vector2d MapSights::View::on_plane(const Pixel& pixel) const {
  return {(pixel.u - intrinsics.cx) / intrinsics.fx, (pixel.v - intrinsics.cy) / intrinsics.fy};
}

MapSights::MapSights(const LandmarkMap& map, const Similarity3& world_from_map) : map_(map) {
  std::vector<std::vector<std::uint32_t>> seen(map.frame_count());
  for (std::uint32_t i = 0; i < map.landmark_count(); ++i) {
    for (const FrameIndex frame : map.observing_frames(LandmarkIndex{i})) {
      seen[frame.value].push_back(i);
    }
  }
  for (std::uint32_t f = 0; f < map.frame_count(); ++f) {
    const auto camera = map.frames().cameras.empty() ? std::nullopt : map.frames().cameras[f];
    if (!camera) continue;
    const Rigid3& map_from_camera = map.world_from_camera(FrameIndex{f});
    View view;
    view.camera_from_world = (world_from_map * Similarity3(map_from_camera)).inverse();
    view.centre = world_from_map * map_from_camera.translation();
    view.camera = camera->value;
    view.intrinsics = intrinsics(map.cameras()[view.camera]);
    view.unit = 1.0 / view.camera_from_world.scale();
    for (const std::uint32_t i : seen[f]) {
      const Eigen::Vector3d x =
          view.camera_from_world * (world_from_map * map.landmarks().positions[i]);
      const auto pixel = project(map.cameras()[view.camera], x);
      if (!pixel) continue;
      const Eigen::Vector2d at = view.on_plane(*pixel);
      view.ranges.push_back({cell(at.x(), at.y()), view.unit * x.norm()});
    }
    std::ranges::sort(view.ranges, {}, &Range::cell);
    views_.push_back(std::move(view));
  }
}

MapSights::Sight MapSights::sight(const View& view, const Eigen::Vector3d& point,
                                  double tolerance) const {
  const Eigen::Vector3d x = view.camera_from_world * point;
  const Camera& camera = map_.cameras()[view.camera];
  const auto pixel = project(camera, x);
  if (!pixel) return Sight::kNone;
  const bool inside = pixel->u >= kBorderPx && pixel->v >= kBorderPx &&
                      pixel->u <= camera.width - kBorderPx && pixel->v <= camera.height - kBorderPx;
  if (!inside) return Sight::kNone;
  const double range = view.unit * x.norm();
  const double margin = tolerance + kRangeShare * range;
  const Eigen::Vector2d at = view.on_plane(*pixel);
  std::size_t before = 0;
  std::size_t behind = 0;
  for (int dy = -1; dy <= 1; ++dy) {
    const std::int64_t middle = cell(at.x(), at.y() + dy * kCell);
    auto found = std::ranges::lower_bound(view.ranges, middle - 1, {}, &Range::cell);
    for (; found != view.ranges.end() && found->cell <= middle + 1; ++found) {
      if (std::abs(found->range - range) <= margin) return Sight::kAgrees;
      ++(found->range < range ? before : behind);
    }
  }
  if (before > behind) return Sight::kHidden;
  return behind > before ? Sight::kThrough : Sight::kOpen;
}

void MapSights::add(Sight sight, Count& count) {
  if (sight == Sight::kNone || sight == Sight::kHidden) return;
  ++count.views;
  if (sight == Sight::kAgrees) ++count.agrees;
  if (sight == Sight::kThrough) ++count.through;
}

}  // namespace cairn::detail
