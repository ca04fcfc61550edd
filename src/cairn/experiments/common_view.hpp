// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <optional>

#include "cairn/geometry/rigid3.hpp"
#include "cairn/map/landmark_map.hpp"

namespace cairn {

/// Two frames, one of each map, that observed the same place.
struct CommonView {
  FrameIndex source;
  FrameIndex target;
  std::size_t landmarks = 0;  ///< of the source, observed by both
};

/// The frames of two aligned maps with the most common landmarks; the first of equals. A source landmark is
/// common to them if its nearest target landmark is within the radius and each is observed in its frame.
/// @param radius in the maps' unit of length, positive
/// @returns std::nullopt if no two frames have a common landmark, or a map has no observations
std::optional<CommonView> find_common_view(const LandmarkMap& source, const LandmarkMap& target,
                                           const Rigid3& target_from_source, double radius);

}  // namespace cairn
