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
  FrameId first;   ///< first keyframe
  FrameId middle;  ///< half of the part's landmarks belong to earlier keyframes
  FrameId last;
  std::vector<LandmarkIndex> landmarks;  ///< no landmark is in two parts
};

/// Positions along a map that is cut into parts; see along_parts().
struct AlongParts {
  std::vector<double> keyframes;  ///< one per keyframe, by index
  std::vector<double> landmarks;  ///< one per landmark, by index; NaN if no keyframe observed it
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();  ///< centroid of all landmarks
};

/// Computes positions along the parts. The middle keyframe of part i is at i + 0.5. The other keyframes are evenly
/// spaced between the middle keyframes; beyond the outermost ones, the spacing continues. A landmark is at the middle
/// one of the keyframes that observed it.
/// @param middles middle keyframes of the map's parts, at least two, in the parts' order
AlongParts along_parts(const LandmarkMap& map, std::span<const FrameId> middles);

constexpr std::size_t kMostParts = 12;

/// Cuts a map into parts with about equally many landmarks.
///
/// The keyframes are in the order of keyframes_in_order(). A landmark belongs to the part that contains the middle one
/// of its observing keyframes. Each cut is where the fewest landmarks were observed on both sides; it differs from an
/// even division by at most a quarter of a part's landmarks.
///
/// @param points         selects the landmarks that take part
/// @param part_landmarks approximate number of landmarks in each part
/// @return at most one part if the map has too few landmarks for two parts, or no observations
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

  /// The parts, prepared on first use; empty if the map is too small for two parts.
  std::span<const PreparedPart> prepared();
  /// Index of each landmark's part, in the order of landmarks_to_align(); prepared().size() for a landmark without a
  /// part.
  std::span<const std::uint32_t> part_of() const { return part_of_; }
  /// Positions along the parts: of keyframes by index in the map, and of landmarks in the order of
  /// landmarks_to_align(). Empty without parts.
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
