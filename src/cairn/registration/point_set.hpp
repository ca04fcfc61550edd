// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "cairn/confidence/metric.hpp"
#include "cairn/map/landmark_map.hpp"

namespace cairn {

/// Points to align, with their confidences.
struct PointSet {
  std::vector<Eigen::Vector3d> positions;
  /// One per point. If empty, the nearest point is always matched. A point with confidence 0 or
  /// less is never matched.
  std::vector<double> confidences;
};

struct PointSetOptions {
  /// Leaves out landmarks with fewer observations, as the paper's authors do. No effect if the map has no
  /// observations.
  std::size_t min_observations = 2;
};

/// The Gaussian splats of a map that serve as landmarks, and the number of rejected splats by
/// reason. Each rejected splat counts under one reason.
struct SplatSelection {
  std::vector<LandmarkIndex> kept;  ///< ascending
  std::size_t transparent = 0;      ///< opacity below 0.5, or unknown extent
  std::size_t large = 0;            ///< longest axis more than 5 times the median
  std::size_t distant =
      0;  ///< background: more than 5 times the median distance from the median position
  std::size_t isolated = 0;  ///< floaters: distance to 6th neighbour more than 5 times the median
  std::size_t plain =
      0;  ///< beyond kMostSplatLandmarks: lowest colour contrast to their neighbours
};

/// More landmarks make an alignment slower and hardly better. Splats of high colour contrast stand
/// out in other splat maps too.
inline constexpr std::size_t kMostSplatLandmarks = 5000;

/// @return std::nullopt if the map has no Gaussian splats
std::optional<SplatSelection> selected_splats(const LandmarkMap& map);

/// The landmarks used by an alignment, by ascending id. selected_splats() selects them from
/// Gaussian splats.
std::vector<LandmarkIndex> landmarks_to_align(const LandmarkMap& map,
                                              const PointSetOptions& options = {});

/// The landmarks of a map as points: point i is landmarks_to_align()[i]. The order by landmark id
/// resolves ties.
/// @param metric computes the confidences; std::nullopt: no confidences
PointSet point_set(const LandmarkMap& map, const std::optional<Metric>& metric,
                   const PointSetOptions& options = {});

}  // namespace cairn
