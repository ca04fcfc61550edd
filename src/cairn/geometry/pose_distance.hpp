// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <span>

#include <Eigen/Core>

#include "cairn/geometry/rigid3.hpp"

namespace cairn {

/// How far apart two poses put the same points: root mean square of the distances between the two
/// places of a point, for points that lie about their centroid as a ball does.
struct PoseDistance {
  Eigen::Vector3d centroid = Eigen::Vector3d::Zero();
  double radius = 0.0;  ///< root mean square distance of the points from their centroid

  /// For these points, at least one.
  static PoseDistance of(std::span<const Eigen::Vector3d> points);

  double operator()(const Rigid3& a, const Rigid3& b) const;
};

/// Covariance of pose.inverse(), for that of the pose; both of left perturbations, (δt, δφ).
Matrix6d inverse_covariance(const Rigid3& pose, const Matrix6d& covariance);

/// The error of a pose under the covariance it is stated with, squared Mahalanobis distance: of a
/// calibrated covariance, chi-squared with 6 degrees of freedom.
/// @param covariance of a left perturbation of `estimate`, (δt, δφ); positive definite
double normalised_squared_error(const Rigid3& estimate, const Matrix6d& covariance,
                                const Rigid3& truth);

/// Below which 95 % of normalised squared errors lie.
inline constexpr double kNormalisedSquaredError95 = 12.592;

}  // namespace cairn
