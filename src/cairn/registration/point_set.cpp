// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/registration/point_set.hpp"

#include <algorithm>
#include <utility>

#include "cairn/map/operations.hpp"
#include "cairn/registration/splat_selection.hpp"

namespace cairn {

std::vector<LandmarkIndex> landmarks_to_align(const LandmarkMap& map,
                                              const PointSetOptions& options) {
  auto splats = selected_splats(map);
  std::vector<LandmarkIndex> kept =
      splats ? std::move(splats->kept) : landmarks_observed(map, options.min_observations);
  const auto& ids = map.landmarks().ids;
  std::sort(kept.begin(), kept.end(),
            [&](LandmarkIndex a, LandmarkIndex b) { return ids[a.value] < ids[b.value]; });
  return kept;
}

PointSet point_set(const LandmarkMap& map, const std::optional<Metric>& metric,
                   const PointSetOptions& options) {
  const std::vector<LandmarkIndex> kept = landmarks_to_align(map, options);
  PointSet points;
  points.positions.reserve(kept.size());
  for (const LandmarkIndex landmark : kept) {
    points.positions.push_back(map.landmarks().positions[landmark.value]);
  }
  if (metric) {
    const std::vector<double> all = metric->evaluate(map);
    points.confidences.reserve(kept.size());
    for (const LandmarkIndex landmark : kept) points.confidences.push_back(all[landmark.value]);
  }
  return points;
}

}  // namespace cairn
