// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/alignment/detail/spatial_groups.hpp"

#include <algorithm>
#include <cstdint>
#include <numeric>

namespace cairn::detail {
namespace {

using PlacesToGroup = std::span<std::uint32_t>;

void group(std::span<const Eigen::Vector3d> points, PlacesToGroup indices, std::size_t first,
           std::size_t count, std::vector<std::size_t>& groups) {
  if (count == 1 || indices.size() < 2) {
    for (const std::uint32_t i : indices) groups[i] = first;
    return;
  }
  Eigen::Array3d low = points[indices.front()];
  Eigen::Array3d high = low;
  for (const std::uint32_t i : indices) {
    low = low.min(points[i].array());
    high = high.max(points[i].array());
  }
  Eigen::Index axis = 0;
  (high - low).maxCoeff(&axis);
  const std::size_t middle = indices.size() / 2;
  std::nth_element(indices.begin(), indices.begin() + static_cast<std::ptrdiff_t>(middle),
                   indices.end(), [&](std::uint32_t a, std::uint32_t b) {
                     // Ties by index, so that all platforms give the same groups.
                     return points[a][axis] != points[b][axis] ? points[a][axis] < points[b][axis]
                                                               : a < b;
                   });
  group(points, indices.first(middle), first, count / 2, groups);
  group(points, indices.subspan(middle), first + count / 2, count / 2, groups);
}

}  // namespace

std::vector<std::size_t> spatial_groups(std::span<const Eigen::Vector3d> points,
                                        std::size_t count) {
  std::vector<std::size_t> groups(points.size());
  std::vector<std::uint32_t> indices(points.size());
  std::iota(indices.begin(), indices.end(), 0U);
  group(points, indices, 0, count, groups);
  return groups;
}

}  // namespace cairn::detail
