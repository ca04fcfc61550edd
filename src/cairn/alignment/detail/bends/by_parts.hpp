// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "cairn/alignment/bends.hpp"

namespace cairn::detail {

/// Whether two maps are aligned as a whole after the bent one is straightened.
///
/// Moves landmarks and keyframes as straightened() does. Refines the straightened map from the single pose and judges it
/// as place() does, by descriptors alone: at least 15 matches must agree outside their largest cluster. An object that
/// stands in two places is found by several parts that see it, but stays a small part of the whole map.
///
/// @param parts   with a consensus
/// @param options of the placement; `search` and `trace` have no effect
bool is_aligned_straightened(const PartsAlignment& parts, const PreparedMap& source,
                             const PreparedMap& target, const AlignOptions& options,
                             const Execution& execution);

}  // namespace cairn::detail
