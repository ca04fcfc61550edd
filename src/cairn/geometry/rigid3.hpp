// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace cairn {

/// Eigen types in Cairn's interfaces have a layout that does not depend on the consumer's instruction set.
using Vector6d = Eigen::Matrix<double, 6, 1, Eigen::DontAlign>;
using Matrix6d = Eigen::Matrix<double, 6, 6, Eigen::DontAlign>;
using Matrix4d = Eigen::Matrix<double, 4, 4, Eigen::DontAlign>;

/// A rotation and a translation, SE(3): `x_in_a = a_from_b * x_in_b`.
///
/// Tangent vectors are (δt, δφ): a translation in metres, then a rotation in radians. They act from
/// the left on both parts separately, as in Cairn's pose covariances: perturbed() has the rotation
/// `Exp(δφ)·R` and the translation `t + δt`.
class Rigid3 {
 public:
  /// The identity.
  Rigid3() = default;
  /// @param rotation of any non-zero norm; is normalised
  Rigid3(const Eigen::Quaterniond& rotation, const Eigen::Vector3d& translation);
  /// @param rotation must be orthonormal with determinant 1; use `from_matrix` for external input
  Rigid3(const Eigen::Matrix3d& rotation, const Eigen::Vector3d& translation);

  /// From an external homogeneous matrix.
  /// @throws Error (misuse) if the last row is not 0 0 0 1, an entry of RᵀR - I exceeds `tolerance`, the
  ///        rotation part is a reflection, or the translation is beyond kLargestCoordinate (limits.hpp)
  static Rigid3 from_matrix(const Matrix4d& matrix, double tolerance = 1e-4);
  /// R = Rz(yaw)·Ry(pitch)·Rx(roll), radians.
  static Rigid3 from_roll_pitch_yaw(const Eigen::Vector3d& translation, double roll, double pitch,
                                    double yaw);

  Eigen::Quaterniond quaternion() const { return Eigen::Quaterniond(rotation_); }
  Eigen::Matrix3d rotation() const { return rotation_.toRotationMatrix(); }
  const Eigen::Vector3d& translation() const { return translation_; }
  Matrix4d matrix() const;
  /// (roll, pitch, yaw) in radians, pitch in [-π/2, π/2]; the inverse of from_roll_pitch_yaw.
  Eigen::Vector3d roll_pitch_yaw() const;
  /// Angle of the rotation, radians in [0, π].
  double angle() const;

  Rigid3 inverse() const;
  Rigid3 operator*(const Rigid3& b_from_c) const;
  Eigen::Vector3d operator*(const Eigen::Vector3d& x_in_b) const;

  /// The pose moved by a small left perturbation (δt, δφ): t + δt, Exp(δφ)·R.
  Rigid3 perturbed(const Vector6d& delta) const;
  /// The δ = (δt, δφ) that satisfies `other = perturbed(δ)`.
  Vector6d difference_to(const Rigid3& other) const;

 private:
  Eigen::Quaternion<double, Eigen::DontAlign> rotation_{1.0, 0.0, 0.0, 0.0};
  Eigen::Vector3d translation_ = Eigen::Vector3d::Zero();
};

/// Rotation by the vector `phi`: axis times angle in radians.
Eigen::Quaterniond rotation_exp(const Eigen::Vector3d& phi);
/// The inverse of rotation_exp, angle in [0, π].
Eigen::Vector3d rotation_log(const Eigen::Quaterniond& rotation);
/// The matrix of the cross product: skew(a)·b = a × b.
Eigen::Matrix3d skew(const Eigen::Vector3d& a);

}  // namespace cairn
