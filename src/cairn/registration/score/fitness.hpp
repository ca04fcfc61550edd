// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "cairn/core/executor.hpp"
#include "cairn/registration/concepts.hpp"

namespace cairn {

/// Squared distance of each point, moved by `search_from_points`, to the nearest point of a set that
/// is not empty.
template <NeighborSearch Search>
std::vector<double> nearest_squared_distances(std::span<const Eigen::Vector3d> points,
                                              const Rigid3& search_from_points,
                                              const Search& search, const Executor& executor) {
  constexpr std::size_t kBlock = 256;
  const Eigen::Matrix3d rotation = search_from_points.rotation();
  const Eigen::Vector3d& translation = search_from_points.translation();
  std::vector<double> distances(points.size());
  executor.for_blocks(points.size(), kBlock, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      std::array<Neighbor, 1> nearest;
      search.nearest(rotation * points[i] + translation, nearest);
      distances[i] = nearest[0].squared_distance;
    }
  });
  return distances;
}

/// The paper's score (Eq. 5, as PCL's getFitnessScore computes it): mean of the squared distances to
/// the nearest points. Nothing of no points. In the square of the unit of length; lower is closer,
/// which is not the same as a better pose.
std::optional<double> fitness_score(std::span<const double> squared_distances);

/// Share of the points whose nearest point lies within `radius`; nothing of no points.
std::optional<double> share_within(std::span<const double> squared_distances, double radius);

}  // namespace cairn
