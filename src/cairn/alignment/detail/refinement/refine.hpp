// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "cairn/alignment/prepared_map.hpp"
#include "cairn/registration/stages.hpp"

namespace cairn::detail {

/// Pairs of landmarks that are known to be the same; indices are those of PreparedMap::cloud().
struct KnownMatches {
  std::vector<Match> pairs;
  /// The initial pose is the least-squares fit to the pairs, and is held; the covariance is that of the fit.
  bool decide = false;
};

/// Same as refine(), but the known matches decide if the objective leaves a direction open or gives no covariance.
/// Well-spread landmarks that are the same determine a pose, whatever the other landmarks do.
RegistrationResult refine_with_known(const PreparedMap& source, const PreparedMap& target,
                                     const RefineOptions& options, KnownMatches known,
                                     const Execution& execution);

}  // namespace cairn::detail
