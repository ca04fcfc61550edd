// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <vector>

#include "cairn/core/log.hpp"
#include "cairn/map/landmark_map.hpp"
#include "cairn/report/report.hpp"

namespace cairn::report {

inline constexpr std::size_t kMostFrameImages = 60;
inline constexpr std::uint32_t kWidestFrameImage = 320;  ///< pixels

/// Images for frames of a map, from the RGB-D sequence that the map was built from. The image of a
/// frame is the colour image nearest in time, if it is within half the median interval between
/// colour images. If more frames have an image than are returned, they are chosen evenly. If a frame
/// has a camera, its image is resampled to fill the frustum that the page draws, without lens
/// distortion; pixels outside the camera's view are grey.
/// @param sequence folder of the sequence
/// @return images in the order of the frames
/// @throws Error (input) naming the folder if no colour image is close in time to a frame, and as
///        ImageSequence and read_color_image()
std::vector<FrameImage> frame_images(const LandmarkMap& map, const std::filesystem::path& sequence,
                                     const LogSink& log = {});

}  // namespace cairn::report
