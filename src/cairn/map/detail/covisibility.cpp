// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/map/detail/covisibility.hpp"

#include <algorithm>
#include <tuple>

#include "cairn/core/detail/disjoint_sets.hpp"

namespace cairn::detail {

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
  DisjointSets sets(map.frame_count());
  for (const CovisibleFrames& one : all) {
    if (sets.first_of(one.first.value) == sets.first_of(one.second.value)) continue;
    sets.join(one.first.value, one.second.value);
    forest_.push_back(one);
  }
}

ConnectedFrames Covisibility::group_of(std::span<const FrameIndex> seeds,
                                       std::span<const FrameIndex> others) const {
  enum class Side { kNeither, kSeeds, kOthers };
  DisjointSets sets(map_.frame_count());
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
  ConnectedFrames group;
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

}  // namespace cairn::detail
