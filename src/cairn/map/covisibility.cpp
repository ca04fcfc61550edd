// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/map/covisibility.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <optional>
#include <tuple>
#include <utility>

#include "cairn/core/detail/disjoint_sets.hpp"
#include "cairn/core/error.hpp"

namespace cairn {
namespace {

std::vector<std::vector<std::uint32_t>> landmarks_by_frame(const LandmarkMap& map) {
  std::vector<std::vector<std::uint32_t>> seen(map.frame_count());
  for (std::uint32_t i = 0; map.has_observations() && i < map.landmark_count(); ++i) {
    for (const FrameIndex frame : map.observing_frames(LandmarkIndex{i})) {
      std::vector<std::uint32_t>& own = seen[frame.value];
      if (own.empty() || own.back() != i) own.push_back(i);
    }
  }
  return seen;
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

  explicit SharedViews(const LandmarkMap& map) : map_(map), seen_(landmarks_by_frame(map)) {
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
      if (!is_similar(here, there)) continue;
      const auto pixel = project(camera, camera_from_world * x);
      if (!pixel || !is_well_inside(camera, *pixel)) continue;
      ++count.expected;
      const auto frames = map_.observing_frames(LandmarkIndex{i});
      const bool sees = std::find(frames.begin(), frames.end(), FrameIndex{to}) != frames.end();
      count.shared += sees ? 1 : 0;
    }
  }

  // Features are matched well over such changes of the direction and distance.
  static bool is_similar(const Eigen::Vector3d& here, const Eigen::Vector3d& there) {
    static const double kLeastCosine = std::cos(20.0 * std::numbers::pi / 180.0);
    constexpr double kMostRatio = 1.5;
    const double near = std::min(here.norm(), there.norm());
    const double far = std::max(here.norm(), there.norm());
    return far < kMostRatio * near && here.dot(there) > kLeastCosine * near * far;
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

}  // namespace

Covisibility::Covisibility(const LandmarkMap& map) : map_(map) {
  const std::vector<std::vector<std::uint32_t>> seen = landmarks_by_frame(map);
  std::vector<CovisibleFrames> all;
  std::vector<std::size_t> shared(map.frame_count());
  for (std::uint32_t i = 0; i < map.frame_count(); ++i) {
    std::fill(shared.begin(), shared.end(), 0);
    for (const std::uint32_t landmark : seen[i]) {
      for (const FrameIndex frame : map.observing_frames(LandmarkIndex{landmark})) {
        ++shared[frame.value];
      }
    }
    for (std::uint32_t j = i + 1; j < map.frame_count(); ++j) {
      if (shared[j] > 0) all.push_back({FrameIndex{i}, FrameIndex{j}, shared[j]});
    }
  }
  std::sort(all.begin(), all.end(), [](const CovisibleFrames& a, const CovisibleFrames& b) {
    if (a.landmarks != b.landmarks) return a.landmarks > b.landmarks;
    return std::tie(a.first, a.second) < std::tie(b.first, b.second);
  });
  detail::DisjointSets sets(map.frame_count());
  for (const CovisibleFrames& one : all) {
    if (sets.first_of(one.first.value) == sets.first_of(one.second.value)) continue;
    sets.join(one.first.value, one.second.value);
    forest_.push_back(one);
  }
}

FrameGroup Covisibility::group_of(std::span<const FrameIndex> seeds,
                                  std::span<const FrameIndex> others) const {
  enum class Side { kNeither, kSeeds, kOthers };
  detail::DisjointSets sets(map_.frame_count());
  std::vector<Side> side(map_.frame_count(), Side::kNeither);  // of each set, by its first frame
  for (const FrameIndex frame : seeds) side[frame.value] = Side::kSeeds;
  for (const FrameIndex frame : others) side[frame.value] = Side::kOthers;
  for (const CovisibleFrames& one : forest_) {
    const std::size_t a = sets.first_of(one.first.value);
    const std::size_t b = sets.first_of(one.second.value);
    if (side[a] != side[b] && side[a] != Side::kNeither && side[b] != Side::kNeither) continue;
    const Side both = side[a] == Side::kNeither ? side[b] : side[a];
    sets.join(a, b);
    side[std::min(a, b)] = both;
  }
  FrameGroup group;
  std::vector<bool> is_inside(map_.frame_count());
  for (std::uint32_t i = 0; i < map_.frame_count(); ++i) {
    is_inside[i] = side[sets.first_of(i)] == Side::kSeeds;
    if (is_inside[i]) group.frames.push_back(FrameIndex{i});
  }
  std::size_t seen = 0;
  std::size_t shared = 0;
  for (std::uint32_t i = 0; i < map_.landmark_count(); ++i) {
    const auto frames = map_.observing_frames(LandmarkIndex{i});
    const auto inside = static_cast<std::size_t>(std::count_if(
        frames.begin(), frames.end(), [&](FrameIndex frame) { return is_inside[frame.value]; }));
    seen += inside > 0 ? 1 : 0;
    shared += inside > 0 && inside < frames.size() ? 1 : 0;
  }
  if (seen > 0) group.shared = static_cast<double>(shared) / static_cast<double>(seen);
  return group;
}

namespace {

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

std::vector<SeparateFrames> separate_frames(const LandmarkMap& map) {
  std::vector<SeparateFrames> result;
  if (!has_images_without_times(map)) return result;
  const Covisibility covisibility(map);
  const SharedViews views(map);
  detail::DisjointSets sets(map.frame_count());
  std::vector<std::vector<std::uint32_t>> members(map.frame_count());
  for (std::uint32_t i = 0; i < members.size(); ++i) members[i] = {i};
  // Joins groups as the forest does, and looks at each pair of groups before.
  for (const CovisibleFrames& one : covisibility.forest()) {
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

}  // namespace cairn
