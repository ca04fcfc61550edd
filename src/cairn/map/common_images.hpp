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

/// The images of a map, and the keypoints of its landmarks. Keeps no reference to the map.
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

  /// The images with new landmark indices. Drops keypoints of landmarks without a new index.
  MapImages renumbered(const std::vector<std::optional<LandmarkIndex>>& landmarks) &&;

 private:
  std::vector<Image> images_;  // by ascending frame
};

/// Common images and landmarks of two maps.
struct CommonImages {
  /// A frame of each map.
  using Frames = std::pair<FrameIndex, FrameIndex>;

  std::vector<Frames> same;  ///< frames of the same image, by ascending first frame
  /// Landmarks of both maps with a common keypoint, by ascending first landmark; each landmark at
  /// most once.
  std::vector<std::pair<LandmarkIndex, LandmarkIndex>> landmarks;
};

/// Finds images that two maps have in common, e.g. two models of overlapping photo sets, or a map
/// and its copy, part or extension.
///
/// Images with timestamps match if the timestamps are equal, and enough observations are at exactly
/// the same pixels (to 1e-3): at least 4, and at least half of those of the image with fewer
/// observations. Timestamps alone do not suffice, because many clocks start at 0. Names are
/// ignored, because sessions number their images alike.
/// Other images with the same name, or the same base name that is unique in both maps, match if at
/// least 4 observations are at exactly the same pixels and the sizes are equal. They also match if
/// at least 3 observations, and a tenth of those of the image with fewer, are within half a pixel.
/// Images with different names match if at least 20 observations, and a quarter of those of the
/// image with fewer, are at exactly the same pixels. Without a name, nine in ten must be, because
/// keypoints of a stationary camera may repeat. Pixels of several observations do not count.
CommonImages common_images(const MapImages& first, const MapImages& second);

}  // namespace cairn
