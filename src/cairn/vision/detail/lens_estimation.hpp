// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <span>

#include "cairn/geometry/rigid3.hpp"
#include "cairn/map/camera.hpp"
#include "cairn/vision/detail/pose_estimation.hpp"

namespace cairn::detail {

/// A lens and the pose of its camera, found together.
struct LensEstimate {
  Camera camera;  ///< in COLMAP's model RADIAL
  Rigid3 world_from_camera;
  Matrix6d covariance = Matrix6d::Zero();  ///< of the pose, including the uncertainty of the lens
  double focal_length_sigma = 0.0;         ///< standard deviation, pixels
};

/// The camera in model RADIAL without distortion.
Camera radial_camera(const Camera& camera, double focal_length);

/// Minimises the robust sum of squared residuals over pose, focal length and distortion. Gaussian priors expect a focal
/// length of about the image's larger side and little distortion. Few or coplanar matches then give a large standard
/// deviation rather than an arbitrary lens. The principal point is fixed; its usual error is part of the covariance, as
/// in a Schmidt-Kalman filter.
/// @param camera  where the search begins; as from radial_camera()
/// @param matches with pixels of the original image; their depths are not used
/// @return std::nullopt if the matches do not determine a pose, or no sound camera fits
std::optional<LensEstimate> estimate_lens(const Camera& camera, std::span<const PointMatch> matches,
                                          const Rigid3& world_from_camera);

}  // namespace cairn::detail
