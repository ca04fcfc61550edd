// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "cairn/alignment/prepared_map.hpp"
#include "cairn/registration/stages.hpp"

namespace cairn::detail {

/// As refine(). If the objective leaves a direction open or gives no covariance, the known matches decide: well-spread
/// landmarks that are the same determine a pose whatever the others do.
/// @param known pairs of landmarks that are the same, by their indices in PreparedMap::cloud()
RegistrationResult refine_with_known(const PreparedMap& source, const PreparedMap& target,
                                     const RefineOptions& options, std::vector<Match> known);

}  // namespace cairn::detail
