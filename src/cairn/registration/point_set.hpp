// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "cairn/confidence/metric.hpp"
#include "cairn/map/landmark_map.hpp"

namespace cairn {

/// The points to align, and how far each is trusted.
struct PointSet {
  std::vector<Eigen::Vector3d> positions;
  /// One a point, or empty: then the nearest point is always the match. A point whose confidence is
  /// not positive is never chosen.
  std::vector<double> confidences;
};

struct PointSetOptions {
  /// Landmarks observed less often are left out, as the paper's authors do; of no effect on a map
  /// that does not know its observations.
  std::size_t min_observations = 2;
};

/// The landmarks that take part in an alignment, in the order of their points: by ascending id.
std::vector<LandmarkIndex> landmarks_to_align(const LandmarkMap& map,
                                              const PointSetOptions& options = {});

/// The landmarks of a map as points, by ascending landmark id, so that ties between points resolve by
/// id: point i is landmarks_to_align()[i].
/// @param metric gives the confidences; nothing: none
PointSet point_set(const LandmarkMap& map, const std::optional<Metric>& metric,
                   const PointSetOptions& options = {});

}  // namespace cairn
