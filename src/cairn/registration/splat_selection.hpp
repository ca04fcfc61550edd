// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "cairn/map/landmark_map.hpp"

namespace cairn {

/// The Gaussian splats of a map that serve as landmarks, and the counts of those left out, by reason; each is counted
/// under one.
struct SplatSelection {
  std::vector<LandmarkIndex> kept;  ///< ascending
  std::size_t transparent = 0;      ///< opacity below 0.5, or unknown extent
  std::size_t large = 0;            ///< longest axis more than 5 times the median's
  std::size_t distant =
      0;  ///< background: more than 5 times the median distance from the median position
  std::size_t isolated = 0;  ///< floaters: 6th neighbour more than 5 times as far as the median's
  std::size_t plain =
      0;  ///< beyond kMostSplatLandmarks, of colours most like those of their neighbours
};

/// More make an alignment slower and hardly better. Splats of outstanding colour stand out in another splat too.
inline constexpr std::size_t kMostSplatLandmarks = 5000;

/// @return std::nullopt if the map has no Gaussian splats
std::optional<SplatSelection> selected_splats(const LandmarkMap& map);

}  // namespace cairn
