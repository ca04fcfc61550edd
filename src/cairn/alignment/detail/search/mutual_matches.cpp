// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/alignment/detail/search/mutual_matches.hpp"

#include <span>

#include "cairn/geometry/moved_points.hpp"

namespace cairn {
namespace {

std::vector<Neighbor> nearest_of_each(std::span<const Eigen::Vector3d> moved,
                                      const BatchTree& tree) {
  std::vector<Neighbor> found(moved.size());
  tree.batch(1).for_each(moved, Executor(), [&](std::size_t i, const NearestList auto& nearest) {
    found[i] = {nearest.index(0), nearest.squared_distance(0)};
  });
  return found;
}

}  // namespace

std::vector<MutualMatch> mutual_matches(const PreparedCloud& source, const PreparedCloud& target,
                                        const Similarity3& pose, std::size_t sample) {
  const std::vector<Neighbor> there = nearest_of_each(
      moved_points(std::span(source.landmarks().positions).first(sample), pose), target.tree());
  std::vector<Eigen::Vector3d> met;
  met.reserve(sample);
  for (const Neighbor& neighbor : there) {
    met.push_back(target.landmarks().positions[neighbor.index]);
  }
  const std::vector<Neighbor> back =
      nearest_of_each(moved_points(met, pose.inverse()), source.tree());
  std::vector<MutualMatch> matches;
  for (std::uint32_t i = 0; i < sample; ++i) {
    if (back[i].index == i) matches.push_back({i, there[i].index, there[i].squared_distance});
  }
  return matches;
}

}  // namespace cairn
