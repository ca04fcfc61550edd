// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "cairn/alignment/bends.hpp"

namespace cairn::detail {

/// Whether two maps are aligned as a whole after the bent one is straightened.
///
/// Straightens the bent map as straightened() does, refines it from the single pose `parts.target_from_source`, and
/// judges the result as place() does. Descriptors must decide: at least 15 matches outside their largest cluster must
/// agree. Several parts can be aligned by one object that stands in two places; in the whole map, this object is only a
/// small part.
///
/// @param parts   result with a consensus
/// @param options options of the placement; `search` and `trace` have no effect
bool is_aligned_straightened(const PartsAlignment& parts, const PreparedMap& source,
                             const PreparedMap& target, const AlignOptions& options,
                             const Execution& execution);

}  // namespace cairn::detail
