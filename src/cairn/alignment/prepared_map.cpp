// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/alignment/prepared_map.hpp"

#include <optional>
#include <utility>
#include <vector>

#include "cairn/alignment/detail/bends/map_drift.hpp"
#include "cairn/alignment/detail/bends/map_parts.hpp"
#include "cairn/alignment/detail/prepared_cloud.hpp"
#include "cairn/map/common_images.hpp"

namespace cairn {

PreparedMap::PreparedMap(LandmarkCloud cloud, std::string_view name, const Execution& execution)
    : cloud_(std::make_shared<const detail::PreparedCloud>(std::move(cloud), execution.seed,
                                                           execution.executor, name)) {
  constexpr std::size_t kDense = 2 * detail::PreparedCloud::kSample;
  const LandmarkCloud& landmarks = cloud_->landmarks();
  if (landmarks.size() <= kDense || landmarks.descriptors || !landmarks.views.empty()) return;
  even_ = std::make_shared<const detail::PreparedCloud>(cloud_->even(execution.executor));
}

PreparedMap::PreparedMap(const LandmarkMap& map, const PrepareOptions& options,
                         const Execution& execution)
    : PreparedMap(landmark_cloud(map, options.confidence, options.points), "cloud", execution) {
  length_unit_ = map.info().length_unit;
  gravity_ = map.info().gravity;
  const std::vector<LandmarkIndex> given = landmarks_to_align(map, options.points);
  std::vector<LandmarkIndex> landmarks;  // in the order of the cloud
  std::vector<std::optional<LandmarkIndex>> in_cloud(map.landmark_count());
  for (std::uint32_t i = 0; i < given.size(); ++i) {
    landmarks.push_back(given[cloud_->as_given(i)]);
    in_cloud[landmarks.back().value] = LandmarkIndex{i};
  }
  MapImages images(map);
  if (!images.all().empty()) {
    images_ = std::make_shared<const MapImages>(std::move(images).renumbered(in_cloud));
  }
  detail::MapDrift drift(map, landmarks);
  if (!drift.empty()) drift_ = std::make_shared<const detail::MapDrift>(std::move(drift));
  parts_ = std::make_shared<detail::PreparedParts>(map, options, execution.seed);
}

}  // namespace cairn
