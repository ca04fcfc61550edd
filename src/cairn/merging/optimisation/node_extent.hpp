// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "cairn/map/landmark_map.hpp"
#include "cairn/merging/optimisation/optimise_poses.hpp"

namespace cairn {

/// Centre and radius of a map's landmarks, by medians, robust to outliers.
NodeExtent node_extent(const LandmarkMap& map);

}  // namespace cairn
