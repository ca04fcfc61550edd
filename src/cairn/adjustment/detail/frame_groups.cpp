// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/adjustment/detail/frame_groups.hpp"

#include "cairn/core/detail/disjoint_sets.hpp"

namespace cairn::detail {

std::vector<FrameGroup> frame_groups(const LandmarkMap& map, const RigidFrames& rigid,
                                     std::span<const std::vector<Measurement>> measurements,
                                     std::size_t min_observations) {
  detail::DisjointSets connected(map.frame_count());
  std::vector<bool> observes(map.frame_count(), false);
  for (const std::vector<Measurement>& landmark : measurements) {
    for (const Measurement& one : landmark) {
      observes[one.frame.value] = true;
      if (landmark.size() < min_observations) continue;
      connected.join(landmark.front().frame.value, one.frame.value);
    }
  }
  // A frame without observations moves with its rig.
  for (std::uint32_t i = 0; i < map.frame_count(); ++i) {
    connected.join(rigid.lead[i], i);
    if (observes[i]) observes[rigid.lead[i]] = true;
  }
  std::vector<FrameGroup> groups;
  std::vector<std::size_t> group_of(map.frame_count());
  for (std::uint32_t i = 0; i < map.frame_count(); ++i) {
    if (!observes[rigid.lead[i]]) continue;
    const std::size_t first = connected.first_of(i);
    if (first == i) {
      group_of[i] = groups.size();
      groups.emplace_back();
    }
    groups[group_of[first]].frames.push_back(i);
  }
  std::vector<bool> has_length(groups.size(), false);  // a depth, or the baseline of a rig
  for (std::size_t g = 0; g < groups.size(); ++g) {
    for (const std::uint32_t frame : groups[g].frames) {
      if (!rigid.camera_from_lead[frame].translation().isZero(0.0)) has_length[g] = true;
    }
  }
  for (std::uint32_t l = 0; l < measurements.size(); ++l) {
    if (measurements[l].empty()) continue;
    const std::size_t group = group_of[connected.first_of(measurements[l].front().frame.value)];
    groups[group].landmarks.push_back(l);
    if (measurements[l].size() < min_observations) continue;
    for (const Measurement& one : measurements[l]) {
      if (one.depth) has_length[group] = true;
    }
  }
  const auto& centres = map.frames().translations;
  for (std::size_t g = 0; g < groups.size(); ++g) {
    if (has_length[g]) continue;
    double farthest = 0.0;
    for (const std::uint32_t frame : groups[g].frames) {
      if (!rigid.leads(frame)) continue;
      const double distance = (centres[frame] - centres[groups[g].frames.front()]).norm();
      if (distance <= farthest) continue;
      farthest = distance;
      groups[g].scale_frame = frame;
    }
  }
  return groups;
}

}  // namespace cairn::detail
