// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/adjustment/detail/frame_groups.hpp"

#include <algorithm>
#include <numeric>

namespace cairn {

std::vector<FrameGroup> frame_groups(const LandmarkMap& map,
                                     std::span<const std::vector<Measurement>> measurements,
                                     std::size_t min_observations) {
  std::vector<std::uint32_t> root(map.frame_count());
  std::iota(root.begin(), root.end(), 0U);
  const auto find = [&](std::uint32_t frame) {
    while (root[frame] != frame) frame = root[frame] = root[root[frame]];
    return frame;
  };
  std::vector<bool> observes(map.frame_count(), false);
  for (const std::vector<Measurement>& landmark : measurements) {
    for (const Measurement& one : landmark) {
      observes[one.frame.value] = true;
      if (landmark.size() < min_observations) continue;
      const std::uint32_t a = find(landmark.front().frame.value);
      const std::uint32_t b = find(one.frame.value);
      root[std::max(a, b)] = std::min(a, b);
    }
  }
  std::vector<FrameGroup> groups;
  std::vector<std::size_t> group_of(map.frame_count());
  for (std::uint32_t i = 0; i < map.frame_count(); ++i) {
    if (!observes[i]) continue;
    const std::uint32_t first = find(i);
    if (first == i) {
      group_of[i] = groups.size();
      groups.emplace_back();
    }
    groups[group_of[first]].frames.push_back(i);
  }
  std::vector<bool> has_depth(groups.size(), false);
  for (std::uint32_t l = 0; l < measurements.size(); ++l) {
    if (measurements[l].empty()) continue;
    const std::size_t group = group_of[find(measurements[l].front().frame.value)];
    groups[group].landmarks.push_back(l);
    if (measurements[l].size() < min_observations) continue;
    for (const Measurement& one : measurements[l]) {
      if (one.depth) has_depth[group] = true;
    }
  }
  const auto& centres = map.frames().translations;
  for (std::size_t g = 0; g < groups.size(); ++g) {
    if (has_depth[g]) continue;
    double farthest = 0.0;
    for (const std::uint32_t frame : groups[g].frames) {
      const double distance = (centres[frame] - centres[groups[g].frames.front()]).norm();
      if (distance <= farthest) continue;
      farthest = distance;
      groups[g].scale_frame = frame;
    }
  }
  return groups;
}

}  // namespace cairn
