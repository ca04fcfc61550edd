// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/placement/support.hpp"

#include <algorithm>
#include <cstdint>
#include <vector>

namespace cairn {
namespace {

std::vector<Neighbor> nearest_of_each(const std::vector<Eigen::Vector3d>& points,
                                      const Rigid3& pose, const BatchTree& tree) {
  const Eigen::Matrix3d rotation = pose.rotation();
  std::vector<Eigen::Vector3d> moved;
  moved.reserve(points.size());
  for (const Eigen::Vector3d& point : points) {
    moved.emplace_back(rotation * point + pose.translation());
  }
  std::vector<Neighbor> found(points.size());
  tree.batch(1).for_each(moved, Executor(), [&](std::size_t i, const NearestList auto& nearest) {
    found[i] = {nearest.index(0), nearest.squared_distance(0)};
  });
  return found;
}

double share_within(const std::vector<Neighbor>& found, double squared_radius) {
  const auto count = std::count_if(found.begin(), found.end(), [&](const Neighbor& neighbor) {
    return neighbor.squared_distance <= squared_radius;
  });
  return static_cast<double>(count) / static_cast<double>(found.size());
}

}  // namespace

PoseSupport SupportCounter::operator()(const Rigid3& pose, double radius) const {
  const std::vector<Neighbor> to_target =
      nearest_of_each(pair_.source().positions, pose, target_tree_);
  const std::vector<Neighbor> to_source =
      nearest_of_each(pair_.target().positions, pose.inverse(), source_tree_);
  const double squared = radius * radius;
  std::size_t mutual = 0;
  for (std::uint32_t i = 0; i < to_target.size(); ++i) {
    const Neighbor& neighbor = to_target[i];
    if (neighbor.squared_distance <= squared && to_source[neighbor.index].index == i) ++mutual;
  }
  const std::size_t smaller = std::min(to_target.size(), to_source.size());
  return {static_cast<double>(mutual) / static_cast<double>(smaller),
          {share_within(to_target, squared), share_within(to_source, squared)}};
}

}  // namespace cairn
