// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "cairn/geometry/similarity3.hpp"
#include "cairn/placement/prepared_cloud.hpp"

namespace cairn {

/// A landmark of each cloud, each the other's nearest at a pose.
struct MutualMatch {
  std::uint32_t source = 0;
  std::uint32_t target = 0;
  double squared_distance = 0.0;  ///< in the target's unit
};

/// The mutual matches of the first landmarks of the source with all of the target, at a centred pose, by
/// source landmark.
/// @param sample how many landmarks of the source are looked at; at most its size
std::vector<MutualMatch> mutual_matches(const PreparedCloud& source, const PreparedCloud& target,
                                        const Similarity3& pose, std::size_t sample);

}  // namespace cairn
