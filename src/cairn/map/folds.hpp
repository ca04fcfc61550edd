// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "cairn/core/ids.hpp"
#include "cairn/geometry/similarity3.hpp"
#include "cairn/map/common_images.hpp"
#include "cairn/map/landmark_map.hpp"

namespace cairn {

/// A map and its pose.
struct MapInWorld {
  const LandmarkMap* map = nullptr;  ///< not null
  Similarity3 world_from_map;
};

/// Misplaced part of a map, as revealed by another map.
struct MapFold {
  std::vector<FrameIndex> frames;  ///< ascending
  std::size_t other = 0;           ///< index of the revealing map
  /// Median pose differences of the contradictory common images; `apart` in world units.
  double apart = 0.0;
  double turned_deg = 0.0;
};

/// Frames that view the same landmarks as other frames from similar viewpoints, but share few of
/// them.
struct SeparateFrames {
  std::vector<FrameIndex> frames;  ///< ascending
  double shared = 0.0;             ///< share of the landmarks in view of both that both observe
  /// The lower of the shares within the group and within the other frames.
  double usual = 0.0;
};

/// Pose differences of two maps' common images in the world (`apart` in its unit), in the order of
/// CommonImages::same.
struct PoseDifferences {
  std::vector<double> apart;
  std::vector<double> turned_deg;
};

PoseDifferences pose_differences(const MapInWorld& first, const MapInWorld& second,
                                 const CommonImages& common);

/// The fold of each map, as revealed by other maps; std::nullopt if none.
///
/// A folded map confuses two similar places. Images in common with another map reveal a fold: some
/// contradict the other map, with camera centres apart by more than ten times the median and
/// rotations that differ by more than 10°; the rest agree. The fold comprises all frames connected
/// more strongly, by common landmarks, to the contradictory images than to the agreeing ones. Of
/// the two maps, the one whose group has the smaller share of landmarks in common with the rest is
/// folded.
/// @param maps aligned with each other
std::vector<std::optional<MapFold>> find_folds(std::span<const MapInWorld> maps);

/// Groups of at least three frames that, by their poses, view the same landmarks as other frames,
/// but have less than a quarter of the map's usual share of them in common. Either the model
/// confuses two similar places (a fold), or a loop is not closed. Only for maps with image names
/// and no timestamps, because a session that remaps a revisited place is no defect.
std::vector<SeparateFrames> separate_frames(const LandmarkMap& map);

/// Names of the first eight frames' images, for display: "a.jpg, b.jpg, ...".
std::string image_list(const LandmarkMap& map, std::span<const FrameIndex> frames);

/// "a is folded: 7 of its 26 images are elsewhere in b, 1.39 away and turned by 105 deg: c.jpg, ...".
std::string fold_text(const MapFold& fold, const LandmarkMap& map, std::string_view name,
                      std::string_view other);

}  // namespace cairn
