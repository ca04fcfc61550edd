// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/placement/prepared_map.hpp"

namespace cairn {

PreparedMap::PreparedMap(const LandmarkMap& map, const PrepareOptions& options)
    : cloud_(landmark_cloud(map, options.confidence, options.points), options.seed,
             options.executor),
      length_unit_(map.info().length_unit),
      gravity_(map.info().gravity) {}

}  // namespace cairn
