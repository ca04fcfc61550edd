// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>
#include <string>

#include <Eigen/Core>

#include "cairn/geometry/similarity3.hpp"

namespace cairn {

/// Fast sufficient test of a covariance: true only if covariance_defect() finds no defect. Uses no
/// roots, divisions or calls, because maps contain millions of covariances. Adds less than the
/// tolerance to the diagonal, then requires all leading minors to exceed the rounding error
/// (Sylvester's criterion).
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

/// The defect of `covariance`: not finite, not symmetric, or a negative eigenvalue; empty if valid.
/// The last two tests tolerate 1e-6 of the largest entry, for decimal input.
std::string covariance_defect(const Eigen::Matrix3d& covariance);

/// The defect of a pose covariance, (δt, δφ) in any units.
std::string pose_covariance_defect(const Matrix6d& covariance);

/// Largest absolute eigenvalue of a symmetric matrix.
double spectral_norm(const Eigen::Matrix3d& symmetric);

/// Covariance of R·x from the covariance of x.
Eigen::Matrix3d rotated_covariance(const Eigen::Matrix3d& covariance, const Eigen::Matrix3d& r);

/// Covariance of J·x from the covariance of x: J·C·Jᵀ, exactly symmetric despite rounding.
template <class Matrix>
Matrix propagated_covariance(const Matrix& jacobian, const Matrix& covariance) {
  const Matrix result = jacobian * covariance * jacobian.transpose();
  return 0.5 * (result + result.transpose());
}

/// Transforms the covariance of a pose `a_from_b` (left perturbation, order δt, δφ) to the
/// covariance of `c_from_a * a_from_b`.
Matrix6d left_transformed_covariance(const Matrix6d& covariance, const Rigid3& c_from_a);
/// As above, with a change of the length unit.
Matrix6d left_transformed_covariance(const Matrix6d& covariance, const Similarity3& c_from_a);

/// Jacobian of a point x = s·R·x' + t with respect to a left perturbation (δt, δφ, δ log s) of the
/// pose (s, R, t): δx = δt + δφ × (x - t) + δ log s · (x - t).
/// @param arm x - t
inline Eigen::Matrix<double, 3, 7> point_by_pose(const Eigen::Vector3d& arm) {
  Eigen::Matrix<double, 3, 7> derivative;
  derivative << Eigen::Matrix3d::Identity(), -skew(arm), arm;
  return derivative;
}

/// Moves the reference point of a pose covariance, (δt, δφ) or (δt, δφ, δ log s), from the source's
/// origin to another point fixed to the source, e.g. a landmark. δt is then the displacement of
/// this point.
/// @param arm vector from the source origin to the point, in the target frame: s·R·x for x in the
///        source
template <class Matrix>
Matrix covariance_at_point(const Matrix& covariance, const Eigen::Vector3d& arm) {
  Matrix jacobian = Matrix::Identity();
  jacobian.template topRows<3>() =
      point_by_pose(arm).template leftCols<Matrix::ColsAtCompileTime>();
  return propagated_covariance(jacobian, covariance);
}

/// Covariance of pose.inverse() from the covariance of `pose`; left perturbations (δt, δφ).
Matrix6d inverse_covariance(const Rigid3& pose, const Matrix6d& covariance);
/// As above, with scale: (δt, δφ, δ log s).
Matrix7d inverse_covariance(const Similarity3& pose, const Matrix7d& covariance);

/// Squared Mahalanobis distance of a pose error under the stated covariance; for a calibrated
/// covariance, chi-squared with 6 degrees of freedom.
/// @param covariance of a left perturbation of `estimate`, (δt, δφ); positive definite
double normalised_squared_error(const Rigid3& estimate, const Matrix6d& covariance,
                                const Rigid3& truth);
/// As above for a similarity, (δt, δφ, δ log s): 7 degrees of freedom.
double normalised_squared_error(const Similarity3& estimate, const Matrix7d& covariance,
                                const Similarity3& truth);

/// 95 % quantile of chi-squared, 6 degrees of freedom.
inline constexpr double kNormalisedSquaredError95 = 12.592;
/// As above, 7 degrees of freedom.
inline constexpr double kNormalisedSquaredErrorWithScale95 = 14.067;

}  // namespace cairn
