// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "cairn/core/ids.hpp"
#include "cairn/map/landmark_map.hpp"

namespace cairn {

/// The images of a map, and the pixels where they show its landmarks. Does not refer to the map.
class MapImages {
 public:
  struct Keypoint {
    Pixel pixel;
    LandmarkIndex landmark;
  };
  struct Image {
    FrameIndex frame;
    std::string name;  ///< empty if unknown
    std::optional<double> timestamp_s;
    std::uint32_t width = 0;  ///< pixels; 0 if unknown
    std::uint32_t height = 0;
    std::vector<Keypoint> keypoints;  ///< by ascending u, then v
  };

  MapImages() = default;
  explicit MapImages(const LandmarkMap& map);

  const std::vector<Image>& all() const { return images_; }

  /// The same with other indices of the landmarks, without those that have none.
  MapImages renumbered(const std::vector<std::optional<LandmarkIndex>>& landmarks) &&;

 private:
  std::vector<Image> images_;  // by ascending frame
};

/// What two maps know of the same images.
struct CommonImages {
  /// A frame of each map.
  using Frames = std::pair<FrameIndex, FrameIndex>;

  std::vector<Frames> same;  ///< frames that show one image, by the first map's frame
  /// Landmarks of both maps that one keypoint shows, and so are the same, by the first map's; each landmark at most once.
  std::vector<std::pair<LandmarkIndex, LandmarkIndex>> landmarks;
};

/// Finds images that two maps have in common, such as two models of overlapping sets of photographs, or a map and what
/// was made from it: a copy, a part, a larger map.
///
/// Images with timestamps are the same if these are equal and, because many clocks start at 0, half of the observations
/// of the one with fewer, and at least 4, are at exactly the same pixels. Their names say nothing: sessions number their
/// images alike.
/// Two other images are the same if they have one name, or one base name that is unique in both maps, and one size, and at least
/// 4 observations at exactly the same pixels; or a tenth of the observations of the one with fewer, and at least 3, within
/// half a pixel of the other's. Images with other names are the same if a quarter, and at least 20, of these observations
/// are at exactly the same pixels; without a name, nine in ten, because the keypoints of a camera that stands still may be
/// alike.
CommonImages common_images(const MapImages& first, const MapImages& second);

}  // namespace cairn
