// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "cairn/map/landmark_map.hpp"
#include "cairn/registration/point_set.hpp"

namespace cairn {

/// Consecutive keyframes of a map and the landmarks assigned to them.
struct MapPart {
  FrameId first;   ///< keyframe
  FrameId middle;  ///< half of the landmarks belong to earlier keyframes
  FrameId last;
  std::optional<double> first_s = {};  ///< time of the first keyframe; std::nullopt if unknown
  std::optional<double> last_s = {};
  std::vector<LandmarkIndex> landmarks;  ///< no landmark is in two parts
};

/// Limits of the parts of a map.
struct CutOptions {
  std::size_t landmarks = 600;  ///< approximate number per part; at least 20
  std::size_t parts = 12;       ///< largest number; at least 1
  /// Largest number of a part's landmarks that are placed: the most observed ones.
  std::size_t placed = 1500;
};

/// Keyframes in the order of their times or, if one has no time, of their ids.
std::vector<FrameIndex> keyframes_in_order(const LandmarkMap& map);

/// Positions along a map that is cut into parts.
struct AlongParts {
  std::vector<double> keyframes;                     ///< by index
  std::vector<double> landmarks;                     ///< by index; NaN if no keyframe observed it
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();  ///< centroid of all landmarks
};

/// The middle keyframe of part i is at i + 0.5, and the others are evenly spread between the middles, and on beyond the
/// outermost ones. A landmark is at the middle one of the keyframes that observed it.
/// @param middles keyframes of the map, of at least two parts, in the parts' order
AlongParts along_parts(const LandmarkMap& map, std::span<const FrameId> middles);

/// Cuts a map into parts with about equally many landmarks.
///
/// Orders the keyframes as keyframes_in_order(). A landmark belongs to the part of the middle
/// keyframe of those that observed it. Each cut is where the fewest landmarks were observed on both sides,
/// within a quarter of a part's landmarks from an even division.
///
/// @param points which landmarks take part
/// @return at most one part if the map has too few landmarks for two, or no observations
std::vector<MapPart> cut_into_parts(const LandmarkMap& map, const PointSetOptions& points = {},
                                    const CutOptions& options = {});

}  // namespace cairn
