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
  /// One per point, or empty: then the nearest point is always matched. A point with confidence 0 or less
  /// is never matched.
  std::vector<double> confidences;
};

struct PointSetOptions {
  /// Leaves out landmarks with fewer observations, as the paper's authors do. No effect if the map has no
  /// observations.
  std::size_t min_observations = 2;
};

/// The Gaussian splats of a map that serve as landmarks, and the counts of those left out, by reason; each is counted
/// under one.
struct SplatSelection {
  std::vector<LandmarkIndex> kept;  ///< ascending
  std::size_t transparent = 0;      ///< opacity below 0.5, or unknown extent
  std::size_t large = 0;            ///< longest axis more than 5 times the median's
  std::size_t distant =
      0;  ///< background: more than 5 times the median distance from the median position
  std::size_t isolated = 0;  ///< floaters: 6th neighbour more than 5 times as far as the median's
  std::size_t plain =
      0;  ///< beyond kMostSplatLandmarks, of colours most like those of their neighbours
};

/// More make an alignment slower and hardly better. Splats of outstanding colour stand out in another splat too.
inline constexpr std::size_t kMostSplatLandmarks = 5000;

/// @return std::nullopt if the map has no Gaussian splats
std::optional<SplatSelection> selected_splats(const LandmarkMap& map);

/// The landmarks that take part in an alignment, by ascending id: of Gaussian splats those of selected_splats().
std::vector<LandmarkIndex> landmarks_to_align(const LandmarkMap& map,
                                              const PointSetOptions& options = {});

/// The landmarks of a map as points, by ascending landmark id, so that ties resolve by id: point i is
/// landmarks_to_align()[i].
/// @param metric gives the confidences; std::nullopt: none
PointSet point_set(const LandmarkMap& map, const std::optional<Metric>& metric,
                   const PointSetOptions& options = {});

}  // namespace cairn
