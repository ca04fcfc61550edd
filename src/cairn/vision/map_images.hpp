// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <optional>
#include <span>
#include <string>

#include "cairn/core/execution.hpp"
#include "cairn/map/landmark_map.hpp"
#include "cairn/vision/image.hpp"
#include "cairn/vision/image_locator.hpp"

namespace cairn {

/// An image that was located in a map.
struct LocatedImage {
  std::string name;
  ImageLocation location;  ///< located
};

/// The map with further frames: the images at their poses, each with its matches as observations. Positions of landmarks
/// and other frames are as they were. The UUID is that of the new content.
/// @param images located in this map, with names that its frames do not have
/// @throws Error (misuse) for an image that is not located, or a name that occurs twice
LandmarkMap with_frames(const LandmarkMap& map, std::span<const LocatedImage> images);

/// The map with SIFT descriptors (roots) of its landmarks, from its frames' images: a feature belongs to the nearest
/// observation within a pixel and a half. A landmark has the descriptors of its most distinct views; none if no feature
/// is near its observations. Other descriptors are replaced. The UUID is that of the new content.
/// @param image_of a frame's image; std::nullopt if it has none. Called by several threads
/// @throws Error (input) for an image of another size than the frame's camera has; (cancelled)
LandmarkMap with_image_descriptors(
    const LandmarkMap& map, const std::function<std::optional<GrayImage>(FrameIndex)>& image_of,
    const Execution& execution = {});

/// A map whose landmarks have descriptors of its images.
struct DescribedMap {
  LandmarkMap map;
  std::size_t images = 0;  ///< number of frames whose image was there
};

/// The same with images in files: those of the frames' names, in a folder. Frames whose image is missing have none.
/// @throws Error (input) if no image is there, or naming an image that cannot be read
DescribedMap with_image_descriptors(const LandmarkMap& map, const std::filesystem::path& folder,
                                    const Execution& execution = {});

}  // namespace cairn
