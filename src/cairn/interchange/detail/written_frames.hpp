// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "cairn/map/landmark_map.hpp"

// What the writers of formats with images share. Private to cairn/interchange.
namespace cairn::detail {

/// @param image what the system calls a frame, e.g. "a shot of OpenSfM"
/// @throws Error (input) naming a frame without a camera
void require_cameras(const LandmarkMap& map, std::string_view image);

/// The name of a frame's image, or "frame_ID" where there is none.
std::string image_name(const LandmarkMap& map, FrameIndex frame);

/// A focal length and radial distortion about the optical axis, as RADIAL has them.
struct RadialCamera {
  double focal = 0.0;
  double k1 = 0.0;
  double k2 = 0.0;
};
/// std::nullopt for a camera that has more than these.
std::optional<RadialCamera> radial_camera(const Camera& camera);

/// Where a pixel would be in an undistorted image of focal length fx, relative to the optical axis, in pixels;
/// std::nullopt where no line of sight belongs to it.
std::optional<Pixel> undistorted_offset(const Camera& camera, const Pixel& pixel);

/// The index of each observation's keypoint in its frame: as the map has it, if it has all and none twice in
/// a frame, else counted from 0 in the order of the landmarks.
std::vector<std::uint32_t> keypoint_indices(const LandmarkMap& map);

}  // namespace cairn::detail
