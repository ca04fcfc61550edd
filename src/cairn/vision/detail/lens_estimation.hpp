// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <span>

#include <Eigen/Core>

#include "cairn/geometry/rigid3.hpp"
#include "cairn/map/camera.hpp"
#include "cairn/vision/detail/pose_estimation.hpp"

namespace cairn::detail {

inline constexpr int kLensUnknowns = 5;
/// A lens: logarithm of the focal length, two radial terms of distortion, principal point. Lengths are in larger sides of
/// the image.
using LensVector = Eigen::Matrix<double, kLensUnknowns, 1>;
using LensMatrix = Eigen::Matrix<double, kLensUnknowns, kLensUnknowns>;

/// What is known of a lens before an image is seen.
struct LensPrior {
  LensVector mean = LensVector::Zero();
  LensMatrix information = LensMatrix::Zero();  ///< inverse of the covariance

  /// Of an unknown lens: a focal length of about the larger side (within a factor of two), little distortion (0.2 and
  /// 0.1), and the camera's principal point within 1.5 % of the larger side.
  static LensPrior usual(const Camera& camera);
  /// The same with the camera's principal point.
  static LensPrior usual_about_centre(const Camera& camera);
  /// Of the lens of a camera in model RADIAL, without any doubt.
  static LensPrior certain(const Camera& camera);
};

/// A lens and the pose of its camera, found together.
struct LensEstimate {
  Camera camera;  ///< in COLMAP's model RADIAL
  Rigid3 world_from_camera;
  Matrix6d covariance = Matrix6d::Zero();  ///< of the pose, including the uncertainty of the lens
  LensMatrix lens_covariance = LensMatrix::Zero();
  /// The same by the noise alone: how much the prior pulls the lens depends on it.
  LensMatrix lens_covariance_by_noise = LensMatrix::Zero();

  double focal_length_sigma() const;  ///< standard deviation, pixels
};

/// The lens of a camera in model RADIAL.
LensVector lens_of(const Camera& camera);
/// The camera in model RADIAL with another lens.
Camera with_lens(Camera camera, const LensVector& lens);
/// The camera in model RADIAL without distortion.
Camera radial_camera(const Camera& camera, double focal_length);

/// Minimises the robust sum of squared residuals over pose and lens. Few or coplanar matches give a large standard
/// deviation rather than an arbitrary lens, because of the prior.
/// @param camera  where the search begins; as from radial_camera()
/// @param matches with pixels of the image by that lens; their depths are not used
/// @return std::nullopt if the matches do not determine a pose, or no sound camera fits
std::optional<LensEstimate> estimate_lens(const Camera& camera, std::span<const PointMatch> matches,
                                          const Rigid3& world_from_camera, const LensPrior& prior);

/// How much better matches fit one lens than another: the decrease of half the robust sum of squared residuals, in units
/// of the matches' noise, and as a share.
struct LensGain {
  double decrease = 0.0;
  double share = 0.0;
};

/// @param lens, other results of estimate_lens() for these matches
LensGain gain_of(const LensEstimate& lens, const LensEstimate& other,
                 std::span<const PointMatch> matches);

/// Adds the covariance by a jackknife over eight parts of the image: how the estimate changes without the matches of
/// each. Errors that matches near each other share, as of a bent map or a lens of another model, are only seen like this.
/// @param estimate result of estimate_lens() for the same matches and prior
/// @return whether the matches without each part still determine a pose
bool add_jackknife(LensEstimate& estimate, std::span<const PointMatch> matches,
                   const LensPrior& prior);

}  // namespace cairn::detail
