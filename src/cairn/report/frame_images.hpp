// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <vector>

#include "cairn/core/execution.hpp"
#include "cairn/core/log.hpp"
#include "cairn/map/landmark_map.hpp"
#include "cairn/report/report.hpp"
#include "cairn/report/sections.hpp"

namespace cairn::report {

inline constexpr std::size_t kMostFrameImages = 60;
inline constexpr std::uint32_t kWidestFrameImage = 320;  ///< pixels

/// Largest number of image bytes that LinkImages adds; encoded in a page, they are a third more.
inline constexpr std::size_t kMostLinkImageBytes = std::size_t{8} << 20U;

/// Images for frames of a map, from the sequence that the map was built from, or from a folder of
/// images with the names that the map's frames have. In a sequence, the image of a frame is the
/// colour image nearest in time, if it is within half the median interval between colour images. If
/// more frames have an image than are returned, they are chosen evenly. If a frame has a camera,
/// its image is resampled to fill the frustum that the page draws, without lens distortion; pixels
/// outside the camera's view are grey.
/// @param folder of the sequence or of the images
/// @return images in the order of the frames
/// @throws Error (input) naming the folder if no frame has an image there, and as ImageSequence and
///        read_color_image()
std::vector<FrameImage> frame_images(const LandmarkMap& map, const std::filesystem::path& folder,
                                     const LogSink& log = {});

/// The images of several maps' keyframes. A page shows two of these images for each link.
class LinkImages {
 public:
  /// @param maps null: not shown. The others must outlive this
  /// @param folders as for frame_images(), one per map
  /// @throws Error (input) if a folder has no image of its maps, (misuse) for another number of
  ///        folders
  LinkImages(std::span<const LandmarkMap* const> maps,
             std::span<const std::filesystem::path> folders, const LogSink& log = {});
  ~LinkImages();
  LinkImages(const LinkImages&) = delete;
  LinkImages& operator=(const LinkImages&) = delete;

  /// Adds the two keyframes with the most common landmarks, and their images, to each link. Adds
  /// the number of links without images to the section's text. A source landmark and the target
  /// landmark nearest to it at the link's pose are common if their distance is below the median
  /// distance of neighbouring target landmarks; of several source landmarks, the nearest counts. A
  /// link without a pose is shown at the final poses of its maps, if they are in one frame. If not
  /// all images fit, links with a pose come first, the least certain ones before the others. A
  /// missing or unreadable image is left out; the log names the unreadable file.
  /// @param report after add_network() of these maps and edges
  /// @throws Error (misuse) without a network of as many maps
  void add_to(Report& report, std::span<const NetworkEdge> edges, const Execution& execution = {});

 private:
  class Maps;
  std::unique_ptr<Maps> maps_;
};

}  // namespace cairn::report
