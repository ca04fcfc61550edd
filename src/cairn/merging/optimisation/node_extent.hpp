// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "cairn/map/landmark_map.hpp"
#include "cairn/merging/optimisation/optimise_poses.hpp"

namespace cairn {

/// Where a map's landmarks are, by medians, so that a few landmarks far off do not count.
NodeExtent node_extent(const LandmarkMap& map);

}  // namespace cairn
