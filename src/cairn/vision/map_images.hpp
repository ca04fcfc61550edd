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
#include "cairn/vision/odometry.hpp"

namespace cairn {

/// An image that was located in a map.
struct LocatedImage {
  std::string name;
  ImageLocation location;  ///< with located = true
};

/// Adds images to a map as frames, each at its pose and with its matches as observations. Matched
/// landmarks get the descriptors of these views, and keep those of the most distinct views.
/// Landmark positions and other frames do not change. The UUID is computed from the new content.
/// @param images images located in this map; their names differ from its frames' names
/// @throws Error (misuse) for an image that is not located, or a name that occurs twice
LandmarkMap with_frames(const LandmarkMap& map, std::span<const LocatedImage> images);

/// Adds landmarks that the images of two or more frames show and the map does not have. Features
/// with descriptors of the map's kind are matched between images (mutual nearest neighbours, Lowe's
/// ratio), joined to tracks, and triangulated at the frames' poses. A landmark is kept if its lines
/// of sight differ by at least 2°, each projection is within 2 pixels (of the octave) of its
/// feature, and no landmark of the map is nearer than 2 pixels at its depth. New landmarks have a
/// colour and descriptors and, if the map has covariances, a covariance of their features' errors
/// without the errors of the poses. The UUID is computed from the new content.
/// @param map      map with ORB or SIFT descriptors
/// @param frames   each once; they have cameras
/// @param image_of returns a frame's image; called by several threads
/// @throws Error (input) for an image without the size of its frame's camera, or other descriptors;
///         (misuse) for a frame that is not in the map, is given twice, or has no camera; (cancelled)
LandmarkMap with_new_landmarks(const LandmarkMap& map, std::span<const FrameIndex> frames,
                               const std::function<ColorImage(FrameIndex)>& image_of,
                               const FeatureOptions& features = {},
                               const Execution& execution = {});

/// Replaces the landmarks' descriptors by RootSIFT descriptors from the images of the map's frames.
/// Each observation gets the nearest SIFT feature within 1.5 pixels. A landmark keeps the
/// descriptors of its most distinct views, or none if no feature is near its observations. The UUID
/// is computed from the new content.
/// @param image_of returns a frame's image, or std::nullopt without one; called by several threads
/// @throws Error (input) if an image's size differs from its camera's; (cancelled)
LandmarkMap with_image_descriptors(
    const LandmarkMap& map, const std::function<std::optional<GrayImage>(FrameIndex)>& image_of,
    const Execution& execution = {});

/// A map whose landmarks have descriptors from its images.
struct DescribedMap {
  LandmarkMap map;
  std::size_t images = 0;  ///< number of frames with an image
};

/// As above, with image files in a folder, named as the frames' images. Frames without a file are
/// skipped.
/// @throws Error (input) if the folder has no image of the map, or naming an unreadable image
DescribedMap with_image_descriptors(const LandmarkMap& map, const std::filesystem::path& folder,
                                    const Execution& execution = {});

}  // namespace cairn
