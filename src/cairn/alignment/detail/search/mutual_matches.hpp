// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "cairn/alignment/prepared_cloud.hpp"
#include "cairn/geometry/similarity3.hpp"

namespace cairn {

/// Two landmarks that are mutual nearest neighbours at a pose.
struct MutualMatch {
  std::uint32_t source = 0;
  std::uint32_t target = 0;
  double squared_distance = 0.0;  ///< in the target's unit
};

/// Mutual matches of the first source landmarks with the whole target at a centred pose, by source
/// landmark.
/// @param sample number of source landmarks; at most its size
std::vector<MutualMatch> mutual_matches(const PreparedCloud& source, const PreparedCloud& target,
                                        const Similarity3& pose, std::size_t sample);

}  // namespace cairn
