// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "cairn/map/camera.hpp"
#include "cairn/recording/messages.hpp"

namespace cairn {

/// The camera of a CameraInfo's images as taken, by K and D; of its rectified ones, a pinhole by P.
/// @param place of the CameraInfo, for messages
/// @throws Error (input) for an uncalibrated camera (focal length 0), a distortion model other than plumb_bob,
///         rational_polynomial and equidistant, or a defect
Camera camera_of(const CameraInfo& info, bool is_rectified, const std::string& place);

}  // namespace cairn
