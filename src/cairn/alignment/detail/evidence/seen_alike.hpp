// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "cairn/alignment/alignment.hpp"
#include "cairn/alignment/detail/prepared_cloud.hpp"
#include "cairn/geometry/similarity3.hpp"

namespace cairn::detail {

/// Counts the source's sample at a centred pose. All zeros if the clouds have no views or no descriptors of one kind.
/// @param radius distance within which landmarks count as matched
SeenAlike seen_alike(const PreparedCloud& source, const PreparedCloud& target,
                     const Similarity3& pose, double radius);

}  // namespace cairn::detail
