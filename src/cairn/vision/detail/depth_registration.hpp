// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include <Eigen/Core>

#include "cairn/geometry/rigid3.hpp"
#include "cairn/map/camera.hpp"
#include "cairn/vision/image.hpp"

namespace cairn::detail {

/// Depth of a depth camera for the pixels of another camera beside it, as from where that camera is.
class DepthRegistration {
 public:
  /// Both cameras without a defect.
  DepthRegistration(const Camera& depth, Camera image, const Rigid3& image_from_depth);

  /// Depth in metres along the optical axis, of the image's size. A pixel of the depth camera is a patch that faces it;
  /// the nearest of the patches on a pixel counts. 0 where none is.
  /// @param depth of the depth camera's size
  DepthImage operator()(const DepthImage& depth) const;

 private:
  Camera image_;
  CameraProjection projection_;
  Eigen::Vector3d centre_;  // of the depth camera, in the image's
  // Of the corners of the depth pixels, row by row: x / z and y / z, turned to the image's axes; NaN without a line of
  // sight.
  std::vector<Eigen::Vector3d> corners_;
};

}  // namespace cairn::detail
