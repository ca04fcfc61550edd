// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cstddef>
#include <numeric>
#include <optional>
#include <span>
#include <type_traits>
#include <vector>

#include "cairn/core/execution.hpp"
#include "cairn/geometry/similarity3.hpp"
#include "cairn/registration/stages.hpp"

namespace cairn {

/// Squared distance of each point, moved by `search_from_points`, to the nearest point of a non-empty set.
/// @param queries a batch of a search in that set, for at least one neighbour; queried with the
///        moved points
template <class Batch>
  requires(!NeighborSearch<std::remove_cvref_t<Batch>>)
std::vector<double> nearest_squared_distances(std::span<const Eigen::Vector3d> points,
                                              const Similarity3& search_from_points,
                                              Batch&& queries, const Executor& executor) {
  const std::vector<Eigen::Vector3d> moved = moved_points(points, search_from_points);
  std::vector<double> distances(points.size());
  queries.for_each(moved, executor, [&](std::size_t i, const NearestList auto& nearest) {
    distances[i] = nearest.squared_distance(0);
  });
  return distances;
}

/// The same with a search.
template <NeighborSearch Search>
std::vector<double> nearest_squared_distances(std::span<const Eigen::Vector3d> points,
                                              const Similarity3& search_from_points,
                                              const Search& search, const Executor& executor) {
  return nearest_squared_distances(points, search_from_points, query_batch(search, 1), executor);
}

/// The paper's score (Eq. 5, like PCL's getFitnessScore): mean squared distance to the nearest
/// points, in the squared unit of length; std::nullopt if there are no points. A lower score is a
/// closer fit, not always a better pose.
inline std::optional<double> fitness_score(std::span<const double> squared_distances) {
  if (squared_distances.empty()) return std::nullopt;
  return std::accumulate(squared_distances.begin(), squared_distances.end(), 0.0) /
         static_cast<double>(squared_distances.size());
}

/// Share of the points whose nearest point is within `radius`; std::nullopt if there are no points.
inline std::optional<double> share_within(std::span<const double> squared_distances,
                                          double radius) {
  if (squared_distances.empty()) return std::nullopt;
  const auto within = std::count_if(squared_distances.begin(), squared_distances.end(),
                                    [&](double squared) { return squared <= radius * radius; });
  return static_cast<double>(within) / static_cast<double>(squared_distances.size());
}

}  // namespace cairn
