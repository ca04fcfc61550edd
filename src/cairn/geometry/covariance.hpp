// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>
#include <string>

#include <Eigen/Core>

#include "cairn/geometry/similarity3.hpp"

namespace cairn {

/// Whether `m` is a covariance beyond doubt: true only where covariance_defect finds none. Without roots,
/// divisions or calls, for maps have millions of covariances: with less than the tolerance added to the
/// diagonal, all leading minors are positive (Sylvester's criterion) by more than rounding can make of
/// them.
inline bool is_plainly_covariance(const Eigen::Matrix3d& m) {
  const double sum = m.cwiseAbs().sum();  // at most 9 times the largest entry
  // Products of three entries neither overflow nor underflow; NaN fails too.
  const bool can_multiply = sum > 1e-90 && sum < 1e90;
  if (!can_multiply) return false;
  const double slack = 1e-7 * sum;  // at most 0.9 times the tolerance
  if (std::abs(m(0, 1) - m(1, 0)) > slack || std::abs(m(0, 2) - m(2, 0)) > slack ||
      std::abs(m(1, 2) - m(2, 1)) > slack) {
    return false;
  }
  const double a = m(0, 0) + slack;
  const double b = m(1, 0);
  const double c = m(1, 1) + slack;
  const double d = m(2, 0);
  const double e = m(2, 1);
  const double f = m(2, 2) + slack;
  constexpr double kRounding = 1e-14;
  const double minor = a * c - b * b;
  const double determinant = f * minor - a * e * e + d * (2.0 * b * e - c * d);
  return a > 0.0 && minor > kRounding * sum * sum && determinant > kRounding * sum * sum * sum;
}

/// Why `covariance` is none: not finite, not symmetric, or with a negative eigenvalue; empty if it
/// is one. Both tests allow a relative error of 1e-6 of the largest entry, as decimals cause.
std::string covariance_defect(const Eigen::Matrix3d& covariance);

/// Largest absolute eigenvalue of a symmetric matrix.
double spectral_norm(const Eigen::Matrix3d& symmetric);

/// Covariance of R·x for the covariance of x.
Eigen::Matrix3d rotated_covariance(const Eigen::Matrix3d& covariance, const Eigen::Matrix3d& r);

/// Covariance of J·x for the covariance of x: J·C·Jᵀ, symmetric in spite of rounding.
template <class Matrix>
Matrix propagated_covariance(const Matrix& jacobian, const Matrix& covariance) {
  const Matrix result = jacobian * covariance * jacobian.transpose();
  return 0.5 * (result + result.transpose());
}

/// Covariance of a pose `a_from_b` (left perturbation, order δt, δφ) carried over to
/// `c_from_a * a_from_b`.
Matrix6d left_transformed_covariance(const Matrix6d& covariance, const Rigid3& c_from_a);

/// Covariance of pose.inverse(), for that of the pose; both of left perturbations, (δt, δφ).
Matrix6d inverse_covariance(const Rigid3& pose, const Matrix6d& covariance);
/// The same with the scale's, (δt, δφ, δ log s).
Matrix7d inverse_covariance(const Similarity3& pose, const Matrix7d& covariance);

/// The error of a pose under the covariance it is stated with, squared Mahalanobis distance: of a
/// calibrated covariance, chi-squared with 6 degrees of freedom.
/// @param covariance of a left perturbation of `estimate`, (δt, δφ); positive definite
double normalised_squared_error(const Rigid3& estimate, const Matrix6d& covariance,
                                const Rigid3& truth);
/// The same of a similarity, with the scale's, (δt, δφ, δ log s): 7 degrees of freedom.
double normalised_squared_error(const Similarity3& estimate, const Matrix7d& covariance,
                                const Similarity3& truth);

/// Below which 95 % of normalised squared errors lie.
inline constexpr double kNormalisedSquaredError95 = 12.592;
/// And of those with a scale.
inline constexpr double kNormalisedSquaredErrorWithScale95 = 14.067;

}  // namespace cairn
