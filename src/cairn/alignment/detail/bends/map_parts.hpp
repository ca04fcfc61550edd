// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <mutex>
#include <span>
#include <vector>

#include "cairn/alignment/bends.hpp"
#include "cairn/alignment/prepared_map.hpp"

namespace cairn::detail {

/// Consecutive keyframes of a map and the landmarks assigned to them.
struct MapPart {
  FrameId first;   ///< keyframe
  FrameId middle;  ///< half of the landmarks belong to earlier keyframes
  FrameId last;
  std::vector<LandmarkIndex> landmarks;  ///< no landmark is in two parts
};

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

constexpr std::size_t kMostParts = 12;

/// Cuts a map into parts with about equally many landmarks.
///
/// Orders the keyframes as keyframes_in_order(). A landmark belongs to the part of the middle
/// keyframe of those that observed it. Each cut is where the fewest landmarks were observed on both sides,
/// within a quarter of a part's landmarks from an even division.
///
/// @param points         which landmarks take part
/// @param part_landmarks approximate number in each part
/// @return at most one part if the map has too few landmarks for two, or no observations
std::vector<MapPart> cut_into_parts(const LandmarkMap& map, const PointSetOptions& points = {},
                                    std::size_t part_landmarks = PrepareOptions().part_landmarks);

/// A part of a map, prepared to be placed separately. It is in the frame of the map.
struct PreparedPart {
  MapPart part;
  PreparedMap cloud;
};

/// The parts of a prepared map.
class PreparedParts {
 public:
  PreparedParts(const LandmarkMap& map, const PrepareOptions& options, std::uint64_t seed);

  /// Prepared on first use; empty if the map is too small for two.
  std::span<const PreparedPart> prepared();
  /// Index of each landmark's part, in the order of landmarks_to_align(); prepared().size() for none.
  std::span<const std::uint32_t> part_of() const { return part_of_; }
  /// Where the keyframes, by index in the map, and the landmarks, in the order of landmarks_to_align(), lie along
  /// the parts; empty without parts.
  const AlongParts& along() const { return along_; }

 private:
  std::uint64_t seed_;
  std::once_flag once_;
  std::vector<std::uint32_t> part_of_;
  AlongParts along_;
  std::vector<MapPart> parts_;
  std::vector<LandmarkCloud> clouds_;
  std::vector<PreparedPart> prepared_;
};

}  // namespace cairn::detail
