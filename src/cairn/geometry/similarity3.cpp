// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/geometry/similarity3.hpp"

#include <cmath>
#include <string>

#include <Eigen/LU>
#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/geometry/limits.hpp"

namespace cairn {

Similarity3::Similarity3(double scale, const Rigid3& rigid) : scale_(scale), rigid_(rigid) {
  if (!(scale > 0.0) || !std::isfinite(scale)) {
    throw Error(ErrorKind::kMisuse, "Similarity3", "scale is " + std::to_string(scale),
                "a positive finite number");
  }
}

Similarity3 Similarity3::from_matrix(const Matrix4d& matrix, double tolerance) {
  const double determinant = matrix.topLeftCorner<3, 3>().determinant();
  if (!(determinant > 0.0) || !std::isfinite(determinant)) {
    throw Error(ErrorKind::kMisuse, "Similarity3",
                "the determinant of the upper left part is " + std::to_string(determinant),
                "a positive finite number");
  }
  // RᵀR may differ from I by the tolerance; what is taken for a rigid motion must be one after rounding, too.
  double scale = std::cbrt(determinant);
  if (scale > kLargestCoordinate || scale < 1.0 / kLargestCoordinate) {
    throw Error(ErrorKind::kMisuse, "Similarity3", fmt::format("the scale is {:.6g}", scale),
                "a scale from 1e-9 to 1e9");
  }
  if (std::abs(scale * scale - 1.0) <= 0.99 * tolerance) scale = 1.0;
  Matrix4d rigid = matrix;
  rigid.topLeftCorner<3, 3>() /= scale;
  return {scale, Rigid3::from_matrix(rigid, tolerance)};
}

Matrix4d Similarity3::matrix() const {
  Matrix4d result = rigid_.matrix();
  result.topLeftCorner<3, 3>() *= scale_;
  return result;
}

Similarity3 Similarity3::inverse() const {
  const Eigen::Quaterniond inverse_rotation = rigid_.quaternion().conjugate();
  return {1.0 / scale_,
          Rigid3(inverse_rotation, -(inverse_rotation * rigid_.translation()) / scale_)};
}

Similarity3 Similarity3::operator*(const Similarity3& b_from_c) const {
  return {scale_ * b_from_c.scale_, Rigid3(rigid_.quaternion() * b_from_c.rigid_.quaternion(),
                                           *this * b_from_c.rigid_.translation())};
}

Eigen::Vector3d Similarity3::operator*(const Eigen::Vector3d& x_in_b) const {
  return scale_ * (rigid_.quaternion() * x_in_b) + rigid_.translation();
}

}  // namespace cairn
