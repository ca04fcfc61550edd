// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include <Eigen/Core>

#include "cairn/geometry/rigid3.hpp"

namespace cairn {

/// Why `covariance` is none: not finite, not symmetric, or with a negative eigenvalue; empty if it
/// is one. Both tests allow a relative error of 1e-6 of the largest entry, as decimals cause.
std::string covariance_defect(const Eigen::Matrix3d& covariance);

/// Largest absolute eigenvalue of a symmetric matrix.
double spectral_norm(const Eigen::Matrix3d& symmetric);

/// Covariance of R·x for the covariance of x.
Eigen::Matrix3d rotated_covariance(const Eigen::Matrix3d& covariance, const Eigen::Matrix3d& r);

/// Covariance of a pose `a_from_b` (left perturbation, order δt, δφ) carried over to
/// `c_from_a * a_from_b`.
Matrix6d left_transformed_covariance(const Matrix6d& covariance, const Rigid3& c_from_a);

}  // namespace cairn
