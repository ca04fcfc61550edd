// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/map/folds.hpp"

#include <algorithm>
#include <iterator>
#include <utility>

#include <fmt/format.h>

#include "cairn/core/statistics.hpp"
#include "cairn/geometry/angles.hpp"
#include "cairn/map/covisibility.hpp"

namespace cairn {
namespace {

// Common images by whether both maps have them at one place.
struct Division {
  std::vector<FrameIndex> agreeing;
  std::vector<FrameIndex> contradictory;
  double apart = 0.0;  // of the contradictory ones, the median
  double turned_deg = 0.0;
};

// A model that takes one of two similar places for the other is folded: some images are far from where another model has
// them, while the rest agree.
std::pair<Division, Division> divided(const CommonImages& common, const PoseDifferences& poses) {
  constexpr std::size_t kFewest = 4;  // images, or their median says nothing
  constexpr double kTimesMedian = 10.0;
  constexpr double kTurned = 10.0;  // degrees
  std::pair<Division, Division> result;
  if (common.same.size() < kFewest) return result;
  std::vector<double> apart = poses.apart;
  const double median = upper_median(apart);
  apart.clear();
  std::vector<double> turned;
  for (std::size_t i = 0; i < common.same.size(); ++i) {
    const auto& [one, other] = common.same[i];
    const bool differs = poses.apart[i] > kTimesMedian * median && poses.turned_deg[i] > kTurned;
    (differs ? result.first.contradictory : result.first.agreeing).push_back(one);
    (differs ? result.second.contradictory : result.second.agreeing).push_back(other);
    if (!differs) continue;
    apart.push_back(poses.apart[i]);
    turned.push_back(poses.turned_deg[i]);
  }
  if (apart.empty()) return result;
  result.first.apart = result.second.apart = upper_median(apart);
  result.first.turned_deg = result.second.turned_deg = upper_median(turned);
  return result;
}

void add_fold(const FrameGroup& group, const Division& division, std::size_t other,
              std::optional<MapFold>& fold) {
  if (!fold) fold = MapFold{{}, other, division.apart, division.turned_deg};
  std::vector<FrameIndex> frames;
  std::set_union(fold->frames.begin(), fold->frames.end(), group.frames.begin(), group.frames.end(),
                 std::back_inserter(frames));
  fold->frames = std::move(frames);
}

}  // namespace

PoseDifferences pose_differences(const MapInWorld& first, const MapInWorld& second,
                                 const CommonImages& common) {
  PoseDifferences result;
  for (const auto& [one, other] : common.same) {
    const Rigid3 of_first = first.map->world_from_camera(one);
    const Rigid3 of_second = second.map->world_from_camera(other);
    result.apart.push_back((first.world_from_map * of_first.translation() -
                            second.world_from_map * of_second.translation())
                               .norm());
    result.turned_deg.push_back(
        degrees((first.world_from_map.rigid() * of_first)
                    .quaternion()
                    .angularDistance((second.world_from_map.rigid() * of_second).quaternion())));
  }
  return result;
}

std::vector<std::optional<MapFold>> find_folds(std::span<const MapInWorld> maps) {
  std::vector<std::optional<MapFold>> folds(maps.size());
  std::vector<MapImages> images;
  for (const MapInWorld& placed : maps) images.emplace_back(*placed.map);
  for (std::size_t m = 0; m < maps.size(); ++m) {
    for (std::size_t k = 0; k < m; ++k) {
      const CommonImages common = common_images(images[k], images[m]);
      const auto [of_k, of_m] = divided(common, pose_differences(maps[k], maps[m], common));
      if (of_k.contradictory.empty()) continue;
      // Where a model is folded, only what looks alike connects the part with the rest.
      const FrameGroup part_of_k =
          Covisibility(*maps[k].map).group_of(of_k.contradictory, of_k.agreeing);
      const FrameGroup part_of_m =
          Covisibility(*maps[m].map).group_of(of_m.contradictory, of_m.agreeing);
      if (part_of_k.shared < part_of_m.shared) {
        add_fold(part_of_k, of_k, m, folds[k]);
      } else {
        add_fold(part_of_m, of_m, k, folds[m]);
      }
    }
  }
  return folds;
}

std::string fold_text(const MapFold& fold, const LandmarkMap& map, std::string_view name,
                      std::string_view other) {
  return fmt::format(
      "{} is folded: {} of its {} images are elsewhere in {}, {:.3g} away and turned by {:.0f} "
      "deg: "
      "{}",
      name, fold.frames.size(), map.frame_count(), other, fold.apart, fold.turned_deg,
      image_list(map, fold.frames));
}

}  // namespace cairn
