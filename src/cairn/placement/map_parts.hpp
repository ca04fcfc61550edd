// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "cairn/map/landmark_map.hpp"
#include "cairn/registration/point_set.hpp"

namespace cairn {

/// Consecutive keyframes of a map and the landmarks that belong to them.
struct MapPart {
  FrameId first;   ///< keyframe
  FrameId middle;  ///< half of the landmarks belong to earlier keyframes
  FrameId last;
  std::optional<double> first_s = {};  ///< time of the first keyframe, where the map has times
  std::optional<double> last_s = {};
  std::vector<LandmarkIndex> landmarks;  ///< no landmark belongs to two parts
  /// Of each of them: the share of the part's landmarks that belong to earlier keyframes.
  std::vector<double> along = {};
};

/// Into how many parts a map is cut.
struct CutOptions {
  std::size_t landmarks = 600;  ///< of a part, about; at least 20
  std::size_t parts = 12;       ///< at most; at least 1
};

/// Cuts a map into parts of about as many landmarks each.
///
/// The keyframes are in the order of their times or, if one of them has none, of their ids. A landmark
/// belongs to the part of the keyframe in the middle of those that observed it. The cuts are where the fewest landmarks were
/// observed on both sides, within a quarter of a part's landmarks from an even division.
///
/// @param points which landmarks take part
/// @return one part at most if the map has too few landmarks for two, or no observations
std::vector<MapPart> cut_into_parts(const LandmarkMap& map, const PointSetOptions& points = {},
                                    const CutOptions& options = {});

}  // namespace cairn
