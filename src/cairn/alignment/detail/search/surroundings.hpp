// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "cairn/alignment/detail/evidence/seen_views.hpp"
#include "cairn/alignment/prepared_cloud.hpp"
#include "cairn/geometry/similarity3.hpp"

namespace cairn {

/// Free-space check of the landmarks outside the region where landmarks match, at a centred pose.
///
/// An object that stands in two places matches as well as a place does; its surroundings reveal the
/// difference. The region is a ball around the mutual matches within the radius, without those that
/// have less than half as many matches around them as the median.
///
/// @param radius largest distance of matches that are the same landmark rather than a common surface
/// @return all zeros if there are no matches, or no cloud has views
SightCounts surrounding_sights(const PreparedCloud& source, const PreparedCloud& target,
                               const Similarity3& pose, double radius);

}  // namespace cairn
