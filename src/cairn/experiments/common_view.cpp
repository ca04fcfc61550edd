// SPDX-License-Identifier: BSD-3-Clause
#include <map>
#include <set>
#include <utility>
#include <vector>

#include "cairn/experiments/paper.hpp"
#include "cairn/registration/neighbors/batch_tree.hpp"

namespace cairn {

std::optional<CommonView> find_common_view(const LandmarkMap& source, const LandmarkMap& target,
                                           const Rigid3& target_from_source, double radius) {
  if (!source.has_observations() || !target.has_observations() || target.landmark_count() == 0) {
    return std::nullopt;
  }
  const BatchTree tree(target.landmarks().positions);
  std::map<std::pair<FrameIndex, FrameIndex>, std::size_t> counts;
  std::vector<Eigen::Vector3d> moved;
  for (const Eigen::Vector3d& x : source.landmarks().positions) {
    moved.push_back(target_from_source * x);
  }
  std::vector<Neighbor> nearest(moved.size());
  tree.batch(1).for_each(moved, Executor(), [&](std::size_t i, const NearestList auto& found) {
    nearest[i] = {found.index(0), found.squared_distance(0)};
  });
  for (std::uint32_t i = 0; i < source.landmark_count(); ++i) {
    if (nearest[i].squared_distance > radius * radius) continue;
    const auto seen_by = source.observing_frames(LandmarkIndex{i});
    const auto counterpart_seen_by = target.observing_frames(LandmarkIndex{nearest[i].index});
    // A frame may observe a landmark twice; it has it in view once.
    const std::set<FrameIndex> source_frames(seen_by.begin(), seen_by.end());
    const std::set<FrameIndex> target_frames(counterpart_seen_by.begin(),
                                             counterpart_seen_by.end());
    for (const FrameIndex source_frame : source_frames) {
      for (const FrameIndex target_frame : target_frames) ++counts[{source_frame, target_frame}];
    }
  }
  std::optional<CommonView> best;
  for (const auto& [frames, count] : counts) {
    if (!best || count > best->landmarks) best = CommonView{frames.first, frames.second, count};
  }
  return best;
}

}  // namespace cairn
