// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "cairn/map/landmark_map.hpp"

namespace cairn {

/// The Gaussian splats of a map that serve as landmarks, and the number of rejected splats by
/// reason. Each rejected splat counts under one reason.
struct SplatSelection {
  std::vector<LandmarkIndex> kept;  ///< ascending
  std::size_t transparent = 0;      ///< opacity below 0.5, or unknown extent
  std::size_t large = 0;            ///< longest axis more than 5 times the median
  std::size_t distant =
      0;  ///< background: more than 5 times the median distance from the median position
  std::size_t isolated = 0;  ///< floaters: distance to 6th neighbour more than 5 times the median
  std::size_t plain =
      0;  ///< beyond kMostSplatLandmarks: lowest colour contrast to their neighbours
};

/// More landmarks make an alignment slower and hardly better. Splats of high colour contrast stand
/// out in other splat maps too.
inline constexpr std::size_t kMostSplatLandmarks = 5000;

/// @return std::nullopt if the map has no Gaussian splats
std::optional<SplatSelection> selected_splats(const LandmarkMap& map);

}  // namespace cairn
