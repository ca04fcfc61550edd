// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <optional>

#include "cairn/geometry/rigid3.hpp"
#include "cairn/map/landmark_map.hpp"

namespace cairn {

/// Two frames, one of each map, that see the same place.
struct CommonView {
  FrameIndex source;
  FrameIndex target;
  std::size_t landmarks = 0;  ///< of the source that both see
};

/// The frames of two aligned maps that have the most landmarks in common, of equals the first. A source
/// landmark is common to them if the target landmark nearest to it is within the radius and each is
/// observed in its frame.
/// @param radius in the maps' unit of length, positive
/// @returns nothing if no two frames have a landmark in common, or a map knows no observations
std::optional<CommonView> find_common_view(const LandmarkMap& source, const LandmarkMap& target,
                                           const Rigid3& target_from_source, double radius);

}  // namespace cairn
