// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>

#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "cairn/map/camera.hpp"

namespace cairn::testing {

/// A wall of random blobs at right angles to the optical axis, seen by a camera that moves along it.
struct TexturedWall {
  static constexpr double kDepthM = 2.0;
  static constexpr double kFocal = 500.0;
  /// Metres of the camera's way in which the image moves by one pixel.
  static constexpr double kMetresPerPixel = kDepthM / kFocal;

  TexturedWall() {
    cv::RNG random(7);
    cv::Mat coarse(80, 120, CV_8UC1);
    random.fill(coarse, cv::RNG::UNIFORM, 0, 256);
    cv::resize(coarse, wall, {}, 8.0, 8.0, cv::INTER_CUBIC);
  }

  static Camera camera() {
    Camera camera;
    camera.model = "PINHOLE";
    camera.width = 640;
    camera.height = 480;
    camera.parameters = {kFocal, kFocal, 319.5, 239.5};
    return camera;
  }
  /// What the camera sees after so many pixels of way to the right and downwards.
  cv::Mat gray(int right, int down = 0) const {
    return wall(cv::Rect(100 + right, 60 + down, 640, 480)).clone();
  }
  static cv::Mat depth_m() { return {480, 640, CV_32FC1, cv::Scalar(kDepthM)}; }

  cv::Mat wall;
};

}  // namespace cairn::testing
