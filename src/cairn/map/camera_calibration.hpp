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

/// Camera calibration in the form of OpenCV and ROS, with OpenCV's matrix names.
struct CameraCalibration {
  std::uint32_t width = 0;  ///< pixels
  std::uint32_t height = 0;
  std::string distortion_model;                                       ///< see camera_of()
  std::vector<double> distortion;                                     ///< D
  std::array<double, 9> intrinsics = {};                              ///< K, row-major
  std::array<double, 9> rectification = {1, 0, 0, 0, 1, 0, 0, 0, 1};  ///< R, rectified from camera
  std::array<double, 12> projection = {};                             ///< P of the rectified image
};

/// Two cameras, rigidly mounted.
struct StereoRig {
  Camera left;
  Camera right;
  Rigid3 left_from_right;  ///< metres
};

/// The camera of raw images, from K and D; for rectified images, a pinhole camera from P.
/// @param place location of the calibration, for messages
/// @throws Error (input) for an uncalibrated camera (focal length 0), a defect, or a distortion
///        model other than ROS's plumb_bob, rational_polynomial and equidistant, Kalibr's radtan
///        and EuRoC's radial-tangential
Camera camera_of(const CameraCalibration& calibration, bool is_rectified, const std::string& place);

/// Pose of the right camera of a stereo pair in metres, from R and P of both; std::nullopt if P has
/// no baseline.
/// @param are_rectified whether the images are rectified; R is then ignored
/// @throws Error (input) if an R is not a rotation
std::optional<Rigid3> left_from_right(const CameraCalibration& left, const CameraCalibration& right,
                                      bool are_rectified, const std::string& place);

}  // namespace cairn
