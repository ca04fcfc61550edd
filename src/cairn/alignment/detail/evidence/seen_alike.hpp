// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "cairn/alignment/alignment.hpp"
#include "cairn/alignment/detail/prepared_cloud.hpp"
#include "cairn/geometry/similarity3.hpp"

namespace cairn::detail {

/// Share of the landmarks that were seen alike that are distinctive, at least, in one place. docs/evidence.md explains
/// the choice.
inline constexpr double kLeastDistinctive = 0.05;

/// Counts the source's sample at a centred pose. All zeros if the clouds have no views or no descriptors of one
/// kind, or are too large for all descriptors to be matched.
/// @param radius distance within which landmarks count as matched
/// @param enough share of the landmarks with which the count of distinctive ones ends
SeenAlike seen_alike(const PreparedCloud& source, const PreparedCloud& target,
                     const Similarity3& pose, double radius, double enough = 1.0);

}  // namespace cairn::detail
