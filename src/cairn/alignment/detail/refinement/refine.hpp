// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "cairn/alignment/prepared_map.hpp"
#include "cairn/registration/stages.hpp"

namespace cairn::detail {

/// Pairs of landmarks that are the same, by their indices in PreparedMap::cloud().
struct KnownMatches {
  std::vector<Match> pairs;
  /// The initial pose is their least-squares fit, and is held; its covariance is that of the fit.
  bool decide = false;
};

/// As refine(). If the objective leaves a direction open or gives no covariance, the known matches decide: well-spread
/// landmarks that are the same determine a pose whatever the others do.
RegistrationResult refine_with_known(const PreparedMap& source, const PreparedMap& target,
                                     const RefineOptions& options, KnownMatches known,
                                     const Execution& execution);

}  // namespace cairn::detail
