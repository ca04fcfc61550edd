// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "cairn/geometry/similarity3.hpp"
#include "cairn/map/landmark_map.hpp"

namespace cairn {

// A map made from another keeps what still holds and drops the UUID, which named the other.

/// Landmarks with at least `count` observations; all of them if the map does not know its
/// observations.
std::vector<LandmarkIndex> landmarks_observed(const LandmarkMap& map, std::size_t count);

/// Some rows of a column of descriptors, in the given order.
DescriptorColumn descriptor_rows(const DescriptorColumn& descriptors,
                                 std::span<const std::uint32_t> rows);

/// Only these landmarks, with their observations, in the given order; all frames.
/// @throws Error (misuse) for an index that the map does not have, (input) for one given twice
LandmarkMap with_landmarks(const LandmarkMap& map, std::span<const LandmarkIndex> landmarks);

/// The mini-map of the frames whose id is in [begin, end): those frames and only landmarks that
/// were observed and all of whose observations lie in them.
/// @throws Error (misuse) if the map does not know its observations, or has no such frame
LandmarkMap cut_frames(const LandmarkMap& map, FrameId begin, FrameId end);

/// The map in another world frame: positions, covariances, poses, gravity and georeference moved, all lengths (those
/// and the depths of observations, not named columns) times the scale. The unit of length is said to be
/// the same.
LandmarkMap transformed(const LandmarkMap& map, const Similarity3& new_from_old);

/// The map with its lengths said to be in the unit.
LandmarkMap with_length_unit(const LandmarkMap& map, LengthUnit unit);

/// The map with another georeference, or none.
LandmarkMap with_georeference(const LandmarkMap& map,
                              const std::optional<GeoReference>& georeference);

/// The map moved into the frame of its georeference: metres to the east, to the north and up.
/// @throws Error (input) if it has none
LandmarkMap in_enu_frame(const LandmarkMap& map);

/// The map with a named column added; one of that name is replaced.
/// @param values one a landmark
LandmarkMap with_column(const LandmarkMap& map, const std::string& name,
                        std::vector<double> values);

/// The map with one camera that all its frames are taken by; a camera that is there is replaced.
LandmarkMap with_camera(const LandmarkMap& map, const Camera& camera);

}  // namespace cairn
