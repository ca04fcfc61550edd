// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "cairn/geometry/similarity3.hpp"
#include "cairn/placement/prepared_cloud.hpp"
#include "cairn/placement/seen_views.hpp"

namespace cairn {

/// What the views of either cloud say of those landmarks of the other that lie outside the region where
/// landmarks match, at a centred pose.
///
/// One thing that stands in two places matches as well as a place does. What tells them apart is what
/// stands around it. The region is a ball about the mutual matches within the radius, without those that have
/// less than half as many matches around them as the median.
///
/// @param radius within which a match tells same landmarks from what surfaces have in common
/// @return all zeros where nothing matches, or where no cloud has views
SightCounts surrounding_sights(const PreparedCloud& source, const PreparedCloud& target,
                               const Similarity3& pose, double radius);

}  // namespace cairn
