// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "cairn/geometry/rigid3.hpp"
#include "cairn/map/camera.hpp"

namespace cairn {

/// A calibrated camera as OpenCV and ROS state it, with OpenCV's names of its matrices.
struct CameraCalibration {
  std::uint32_t width = 0;  ///< pixels
  std::uint32_t height = 0;
  std::string distortion_model;                                       ///< see camera_of()
  std::vector<double> distortion;                                     ///< D
  std::array<double, 9> intrinsics = {};                              ///< K, by rows
  std::array<double, 9> rectification = {1, 0, 0, 0, 1, 0, 0, 0, 1};  ///< R, rectified from camera
  std::array<double, 12> projection = {};                             ///< P of the rectified image
};

/// Two cameras, rigidly mounted.
struct StereoRig {
  Camera left;
  Camera right;
  Rigid3 left_from_right;  ///< metres
};

/// The camera of images as taken, by K and D; of rectified ones, a pinhole by P.
/// @param place of the calibration, for messages
/// @throws Error (input) for an uncalibrated camera (focal length 0), a defect, or a distortion model that is none of
///         ROS's (plumb_bob, rational_polynomial, equidistant), Kalibr's radtan and EuRoC's radial-tangential
Camera camera_of(const CameraCalibration& calibration, bool is_rectified, const std::string& place);

/// Where the right camera of a stereo pair is, by R and P of both; std::nullopt if P has no baseline.
/// @param are_rectified whether the images are, so that R does not count
/// @throws Error (input) for an R that is no rotation
std::optional<Rigid3> left_from_right(const CameraCalibration& left, const CameraCalibration& right,
                                      bool are_rectified, const std::string& place);

}  // namespace cairn
