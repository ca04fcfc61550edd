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

/// Part of a map that another map shows to be at the wrong place.
struct MapFold {
  std::vector<FrameIndex> frames;  ///< ascending
  std::size_t other = 0;           ///< index of the map that shows it
  /// By how much the poses of the images differ that both maps contain; medians.
  double apart = 0.0;
  double turned_deg = 0.0;
};

/// Frames that look at the same landmarks as other frames from the same side, but share few of them.
struct SeparateFrames {
  std::vector<FrameIndex> frames;  ///< ascending
  double shared = 0.0;             ///< share of the landmarks in view of both that both observe
  double usual = 0.0;  ///< the same among themselves or among the others, the lower of both
};

/// How far the poses of two maps' common images differ in the world, in the order of CommonImages::same.
struct PoseDifferences {
  std::vector<double> apart;
  std::vector<double> turned_deg;
};

PoseDifferences pose_differences(const MapInWorld& first, const MapInWorld& second,
                                 const CommonImages& common);

/// The fold of each map, as others show it.
///
/// A map is folded where it takes one of two similar places for the other. Images that it has in common with another map
/// show it: some are farther from where the other map has them than ten times the median, and turned by 10° or more. With
/// them, all frames belong to the fold that share more landmarks with them than with the images that agree; of the two
/// maps it is the one in which these frames have fewer of their landmarks in common with the rest.
/// @param maps aligned with each other
std::vector<std::optional<MapFold>> find_folds(std::span<const MapInWorld> maps);

/// Groups of at least three frames that are where other frames are, by their poses, and share less than a quarter of the
/// landmarks that frames so close share elsewhere: a model that takes one of two similar places for the other is folded
/// there, or a loop is not closed. Only of maps whose images have names and no timestamps: mapping a session anew where
/// it returns is no defect.
std::vector<SeparateFrames> separate_frames(const LandmarkMap& map);

/// "a.jpg, b.jpg, ...": the names of the first eight frames' images, for people.
std::string image_list(const LandmarkMap& map, std::span<const FrameIndex> frames);

/// "a is folded: 7 of its 26 images are elsewhere in b, 1.39 away and turned by 105 deg: c.jpg, ...".
std::string fold_text(const MapFold& fold, const LandmarkMap& map, std::string_view name,
                      std::string_view other);

}  // namespace cairn
