// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/alignment/prepared_map.hpp"

#include <utility>

#include "cairn/alignment/detail/bends/map_parts.hpp"
#include "cairn/alignment/detail/prepared_cloud.hpp"

namespace cairn {

PreparedMap::PreparedMap(LandmarkCloud cloud, const PrepareOptions& options, std::string_view name)
    : cloud_(std::make_shared<const detail::PreparedCloud>(std::move(cloud), options.seed,
                                                           options.executor, name)) {}

PreparedMap::PreparedMap(const LandmarkMap& map, const PrepareOptions& options)
    : PreparedMap(landmark_cloud(map, options.confidence, options.points), options) {
  length_unit_ = map.info().length_unit;
  gravity_ = map.info().gravity;
  parts_ = std::make_shared<detail::PreparedParts>(map, options);
}

}  // namespace cairn
