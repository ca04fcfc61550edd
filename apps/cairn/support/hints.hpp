// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "cairn/alignment/align.hpp"
#include "cairn/map/landmark_map.hpp"

namespace cairn::cli {

/// Lines that state what to do about a pose that is not aligned, or was not found: at least one for each way in
/// which align() refuses. A hint names only options that would change something.
/// @param options options of the alignment
/// @param with_scale whether the scale was estimated
std::string hints(const Alignment& alignment, const LandmarkMap& source, const LandmarkMap& target,
                  const AlignOptions& options, bool with_scale);

/// Least value of --min-probability.
inline constexpr double kLeastRequired = 0.5;

/// The line that shows a hint to people.
std::string hint_line(const std::string& hint);

/// The hint to accept a probability below the required one.
/// @param probability of the pose, at least kLeastRequired
std::string accepted_risk_hint(double probability);

}  // namespace cairn::cli
