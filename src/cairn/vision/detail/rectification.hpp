// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "cairn/map/camera.hpp"
#include "cairn/vision/image.hpp"
#include "cairn/vision/sequence.hpp"

namespace cairn::detail {

/// Resamples the images of a rig to those of two equal pinhole cameras that differ by a translation along their rows.
/// Each camera is rotated by half of what lies between the rig's optical axes, so that little is lost at the edges.
class Rectification {
 public:
  /// @param source source of the rig's calibration, for messages
  /// @throws Error (input) for cameras with a defect, of different sizes, a baseline that is not 5 mm to 10 m or not to
  ///        the right, or more than 30 degrees between the axes or the rows
  Rectification(const StereoRig& rig, const std::string& source);

  /// The camera of both rectified images.
  const Camera& camera() const { return camera_; }
  double baseline_m() const { return baseline_m_; }
  /// A pure rotation.
  const Rigid3& left_from_rectified() const { return left_from_rectified_; }

  /// @param image of the rig's size
  template <class ImageOf>
  ImageOf left(ImageOf image) const {
    return resampled(std::move(image), left_);
  }
  template <class ImageOf>
  ImageOf right(ImageOf image) const {
    return resampled(std::move(image), right_);
  }

 private:
  // For each pixel, its position in the original image; empty: the same position.
  using Places = std::vector<Eigen::Vector2f>;

  Places places_in(const Camera& original, const Eigen::Matrix3d& original_from_rectified) const;
  template <class ImageOf>
  static ImageOf resampled(ImageOf image, const Places& places);

  Camera camera_;
  double baseline_m_ = 0.0;
  Rigid3 left_from_rectified_;
  Places left_;
  Places right_;
};

}  // namespace cairn::detail
