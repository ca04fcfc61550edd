// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/map/folds.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <iterator>
#include <utility>

#include <fmt/format.h>

#include "cairn/core/detail/disjoint_sets.hpp"
#include "cairn/core/error.hpp"
#include "cairn/core/statistics.hpp"
#include "cairn/geometry/angles.hpp"
#include "cairn/map/detail/covisibility.hpp"
#include "cairn/map/operations.hpp"

namespace cairn {
namespace {

// Features are matched well over such changes of the direction and distance.
constexpr double kAlikeCosine = 0.93969262078590838;  // of 20 degrees
constexpr double kAlikeDistances = 1.5;

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

void add_fold(const detail::ConnectedFrames& group, const Division& division, std::size_t other,
              std::optional<MapFold>& fold) {
  if (!fold) fold = MapFold{{}, other, division.apart, division.turned_deg};
  std::vector<FrameIndex> frames;
  std::set_union(fold->frames.begin(), fold->frames.end(), group.frames.begin(), group.frames.end(),
                 std::back_inserter(frames));
  fold->frames = std::move(frames);
}

// Every n-th of a list, such that at most `most` are left.
template <typename T>
std::vector<T> thinned(const std::vector<T>& all, std::size_t most) {
  const std::size_t step = (all.size() + most - 1) / most;
  std::vector<T> result;
  for (std::size_t i = 0; i < all.size(); i += std::max<std::size_t>(step, 1)) {
    result.push_back(all[i]);
  }
  return result;
}

// Counts landmarks that pairs of frames should both observe, and those that they do.
class SharedViews {
 public:
  struct Count {
    std::size_t expected = 0;
    std::size_t shared = 0;

    double share() const { return static_cast<double>(shared) / static_cast<double>(expected); }
  };

  explicit SharedViews(const LandmarkMap& map) : map_(map), seen_(detail::landmarks_by_frame(map)) {
    constexpr std::size_t kMostEach = 100;
    for (std::vector<std::uint32_t>& own : seen_) own = thinned(own, kMostEach);
  }

  Count between(const std::vector<std::uint32_t>& some,
                const std::vector<std::uint32_t>& others) const {
    constexpr std::size_t kMostFrames = 64;
    const std::vector<std::uint32_t> few = thinned(some, kMostFrames);
    const std::vector<std::uint32_t> many = thinned(others, kMostFrames);
    Count count;
    for (const std::uint32_t a : few) {
      for (const std::uint32_t b : many) {
        if (a == b) continue;
        add(a, b, count);
        add(b, a, count);
      }
    }
    return count;
  }

 private:
  // Landmarks of one frame that another has in view, from a similar distance and direction.
  void add(std::uint32_t from, std::uint32_t to, Count& count) const {
    const auto& cameras = map_.frames().cameras;
    if (cameras.empty() || !cameras[to]) return;
    const Camera& camera = map_.cameras()[cameras[to]->value];
    const Rigid3 pose = map_.world_from_camera(FrameIndex{to});
    const Rigid3 camera_from_world = pose.inverse();
    const Eigen::Vector3d& place = map_.frames().translations[from];
    for (const std::uint32_t i : seen_[from]) {
      const Eigen::Vector3d& x = map_.landmarks().positions[i];
      const Eigen::Vector3d here = x - place;
      const Eigen::Vector3d there = x - pose.translation();
      if (!are_alike(here, there, kAlikeCosine, kAlikeDistances)) continue;
      const auto pixel = project(camera, camera_from_world * x);
      if (!pixel || !is_well_inside(camera, *pixel)) continue;
      ++count.expected;
      const auto frames = map_.observing_frames(LandmarkIndex{i});
      const bool sees = std::find(frames.begin(), frames.end(), FrameIndex{to}) != frames.end();
      count.shared += sees ? 1 : 0;
    }
  }

  static bool is_well_inside(const Camera& camera, const Pixel& pixel) {
    constexpr double kMargin = 0.02;  // of the image
    const auto inside = [](double x, std::uint32_t size) {
      return x > kMargin * size && x < (1.0 - kMargin) * size;
    };
    return inside(pixel.u, camera.width) && inside(pixel.v, camera.height);
  }

  const LandmarkMap& map_;
  std::vector<std::vector<std::uint32_t>> seen_;
};

bool has_images_without_times(const LandmarkMap& map) {
  const FrameTable& frames = map.frames();
  return !frames.image_names.empty() && frames.timestamps_s.empty() && map.has_observations();
}

// What two groups of frames share, if it is too little.
std::optional<SeparateFrames> separation(const SharedViews& views,
                                         const std::vector<std::uint32_t>& few,
                                         const std::vector<std::uint32_t>& many) {
  constexpr std::size_t kFewestFrames = 3;
  constexpr std::size_t kFewestExpected = 300;
  constexpr double kOfUsual = 0.25;
  if (few.size() < kFewestFrames) return std::nullopt;
  const SharedViews::Count across = views.between(few, many);
  if (across.expected < kFewestExpected) return std::nullopt;
  const SharedViews::Count among_few = views.between(few, few);
  const SharedViews::Count among_many = views.between(many, many);
  if (std::min(among_few.expected, among_many.expected) < kFewestExpected) return std::nullopt;
  const double usual = std::min(among_few.share(), among_many.share());
  if (across.share() >= kOfUsual * usual) return std::nullopt;
  SeparateFrames found{{}, across.share(), usual};
  for (const std::uint32_t frame : few) found.frames.push_back(FrameIndex{frame});
  std::sort(found.frames.begin(), found.frames.end());
  return found;
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
      const detail::ConnectedFrames part_of_k =
          detail::Covisibility(*maps[k].map).group_of(of_k.contradictory, of_k.agreeing);
      const detail::ConnectedFrames part_of_m =
          detail::Covisibility(*maps[m].map).group_of(of_m.contradictory, of_m.agreeing);
      if (part_of_k.shared < part_of_m.shared) {
        add_fold(part_of_k, of_k, m, folds[k]);
      } else {
        add_fold(part_of_m, of_m, k, folds[m]);
      }
    }
  }
  return folds;
}

std::vector<SeparateFrames> separate_frames(const LandmarkMap& map) {
  std::vector<SeparateFrames> result;
  if (!has_images_without_times(map)) return result;
  const detail::Covisibility covisibility(map);
  const SharedViews views(map);
  detail::DisjointSets sets(map.frame_count());
  std::vector<std::vector<std::uint32_t>> members(map.frame_count());
  for (std::uint32_t i = 0; i < members.size(); ++i) members[i] = {i};
  // Joins groups as the forest does, and looks at each pair of groups before.
  for (const detail::CovisibleFrames& one : covisibility.forest()) {
    const auto [low, high] =
        std::minmax({sets.first_of(one.first.value), sets.first_of(one.second.value)});
    if (members[low].size() < members[high].size()) std::swap(members[low], members[high]);
    std::vector<std::uint32_t>& many = members[low];
    std::vector<std::uint32_t>& few = members[high];
    if (auto found = separation(views, few, many)) result.push_back(*std::move(found));
    many.insert(many.end(), few.begin(), few.end());
    few = {};
    sets.join(low, high);
  }
  return result;
}

std::string image_list(const LandmarkMap& map, std::span<const FrameIndex> frames) {
  constexpr std::size_t kShown = 8;
  std::string text;
  for (const FrameIndex frame : frames.first(std::min(frames.size(), kShown))) {
    text += (text.empty() ? "" : ", ") + printable(map.frames().image_names[frame.value]);
  }
  return frames.size() > kShown ? text + ", ..." : text;
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
