// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include <Eigen/Core>

#include "cairn/geometry/rigid3.hpp"
#include "cairn/map/camera.hpp"
#include "cairn/vision/image.hpp"

namespace cairn::detail {

/// Converts the depth of a depth camera to the pixels and the viewpoint of another camera beside it.
class DepthRegistration {
 public:
  /// Both cameras without a defect.
  DepthRegistration(const Camera& depth, Camera image, const Rigid3& image_from_depth);

  /// Depth in metres along the optical axis, in an image of the other camera's size. Each pixel of the depth camera is
  /// a patch that faces it. A pixel of the result has the depth of the nearest patch on it; 0 if there is none.
  /// @param depth depth image of the depth camera's size
  DepthImage operator()(const DepthImage& depth) const;

 private:
  Camera image_;
  CameraProjection projection_;
  Eigen::Vector3d centre_;  // centre of the depth camera in the image's camera
  // Lines of sight of the corners of the depth pixels, row by row, scaled to z = 1 in the depth camera and rotated to
  // the axes of the image's camera; NaN without a line of sight.
  std::vector<Eigen::Vector3d> corners_;
};

}  // namespace cairn::detail
