// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <type_traits>
#include <vector>

#include "cairn/core/executor.hpp"
#include "cairn/geometry/moved_points.hpp"
#include "cairn/registration/concepts.hpp"
#include "cairn/registration/query_batch.hpp"

namespace cairn {

/// Squared distance of each point, moved by `search_from_points`, to the nearest point of a non-empty set.
/// @param queries a batch of a search in that set, for at least one neighbour; it is asked for the moved
///        points
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

/// The paper's score (Eq. 5, like PCL's getFitnessScore): mean squared distance to the nearest points, in
/// the squared unit of length; std::nullopt for no points. Lower is a closer fit, not always a better pose.
std::optional<double> fitness_score(std::span<const double> squared_distances);

/// Share of the points whose nearest point is within `radius`; std::nullopt for no points.
std::optional<double> share_within(std::span<const double> squared_distances, double radius);

}  // namespace cairn
