// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/placement/support.hpp"

#include <algorithm>
#include <cstdint>
#include <span>
#include <vector>

#include "cairn/geometry/moved_points.hpp"

namespace cairn {
namespace {

std::vector<Neighbor> nearest_of_each(std::span<const Eigen::Vector3d> points, const Rigid3& pose,
                                      const BatchTree& tree) {
  const std::vector<Eigen::Vector3d> moved = moved_points(points, pose);
  std::vector<Neighbor> found(points.size());
  tree.batch(1).for_each(moved, Executor(), [&](std::size_t i, const NearestList auto& nearest) {
    found[i] = {nearest.index(0), nearest.squared_distance(0)};
  });
  return found;
}

}  // namespace

double SupportCounter::operator()(const Rigid3& pose, double radius) const {
  const LandmarkCloud& source = pair_.source();
  const LandmarkCloud& target = pair_.target();
  const std::size_t count = std::min(sample_, source.size());
  const std::vector<Neighbor> there =
      nearest_of_each(std::span(source.positions).first(count), pose, target_tree_);
  std::vector<std::uint32_t> asking;
  std::vector<Eigen::Vector3d> met;
  for (std::uint32_t i = 0; i < count; ++i) {
    if (there[i].squared_distance > radius * radius) continue;
    asking.push_back(i);
    met.push_back(target.positions[there[i].index]);
  }
  const std::vector<Neighbor> back = nearest_of_each(met, pose.inverse(), source_tree_);
  std::size_t mutual = 0;
  for (std::size_t i = 0; i < asking.size(); ++i) {
    if (back[i].index == asking[i]) ++mutual;
  }
  const auto of_source = static_cast<double>(mutual) / static_cast<double>(count);
  return of_source * static_cast<double>(source.size()) /
         static_cast<double>(std::min(source.size(), target.size()));
}

}  // namespace cairn
