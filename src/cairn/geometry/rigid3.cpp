// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/geometry/rigid3.hpp"

#include <cmath>
#include <limits>
#include <string>

#include "cairn/core/error.hpp"
#include "cairn/geometry/limits.hpp"

namespace cairn {
namespace {

// Keeps what a normalisation can return, so that a rotation that is written and read again stays the same.
Eigen::Quaterniond unit(const Eigen::Quaterniond& rotation) {
  constexpr double kRounding = 4.0 * std::numeric_limits<double>::epsilon();
  return std::abs(rotation.squaredNorm() - 1.0) <= kRounding ? rotation : rotation.normalized();
}

}  // namespace

Rigid3::Rigid3(const Eigen::Quaterniond& rotation, const Eigen::Vector3d& translation)
    : rotation_(unit(rotation)), translation_(translation) {}

Rigid3::Rigid3(const Eigen::Matrix3d& rotation, const Eigen::Vector3d& translation)
    : Rigid3(Eigen::Quaterniond(rotation), translation) {}

Rigid3 Rigid3::from_matrix(const Matrix4d& matrix, double tolerance) {
  const Eigen::Matrix3d rotation = matrix.topLeftCorner<3, 3>();
  const auto refuse = [](const std::string& what) {
    throw Error(ErrorKind::kMisuse, "transform", what,
                "a rigid transform: rotation, translation and a last row 0 0 0 1");
  };
  if (!matrix.allFinite()) refuse("not all entries are finite");
  if (matrix.row(3) != Eigen::RowVector4d(0.0, 0.0, 0.0, 1.0)) {
    refuse("the last row is not 0 0 0 1");
  }
  const double error =
      (rotation.transpose() * rotation - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff();
  if (error > tolerance) refuse("the 3x3 part is off a rotation by " + std::to_string(error));
  if (rotation.determinant() < 0.0) refuse("the 3x3 part is a reflection");
  const Eigen::Vector3d translation = matrix.topRightCorner<3, 1>();
  refuse_if(!are_coordinates(translation), "transform", "the translation is beyond the limit",
            kExpectedCoordinates);
  return {rotation, translation};
}

Rigid3 Rigid3::from_roll_pitch_yaw(const Eigen::Vector3d& translation, double roll, double pitch,
                                   double yaw) {
  return {Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ()) *
              Eigen::AngleAxisd(pitch, Eigen::Vector3d::UnitY()) *
              Eigen::AngleAxisd(roll, Eigen::Vector3d::UnitX()),
          translation};
}

Matrix4d Rigid3::matrix() const {
  Matrix4d result = Matrix4d::Identity();
  result.topLeftCorner<3, 3>() = rotation();
  result.topRightCorner<3, 1>() = translation_;
  return result;
}

Eigen::Vector3d Rigid3::roll_pitch_yaw() const {
  const Eigen::Matrix3d r = rotation();
  const double cos_pitch = std::hypot(r(0, 0), r(1, 0));
  const double pitch = std::atan2(-r(2, 0), cos_pitch);
  constexpr double kGimbalLock = 1e-9;  // roll and yaw have the same axis: roll is set to 0
  if (cos_pitch < kGimbalLock) return {0.0, pitch, std::atan2(-r(0, 1), r(1, 1))};
  return {std::atan2(r(2, 1), r(2, 2)), pitch, std::atan2(r(1, 0), r(0, 0))};
}

double Rigid3::angle() const {
  return 2.0 * std::atan2(rotation_.vec().norm(), std::abs(rotation_.w()));
}

Rigid3 Rigid3::inverse() const {
  const Eigen::Quaterniond inverse_rotation(rotation_.conjugate());
  return {inverse_rotation, -(inverse_rotation * translation_)};
}

Rigid3 Rigid3::operator*(const Rigid3& b_from_c) const {
  return {Eigen::Quaterniond(rotation_ * b_from_c.rotation_),
          rotation_ * b_from_c.translation_ + translation_};
}

Eigen::Vector3d Rigid3::operator*(const Eigen::Vector3d& x_in_b) const {
  return rotation_ * x_in_b + translation_;
}

Rigid3 Rigid3::perturbed(const Vector6d& delta) const {
  return {rotation_exp(delta.tail<3>()) * quaternion(), translation_ + delta.head<3>()};
}

Vector6d Rigid3::difference_to(const Rigid3& other) const {
  Vector6d delta;
  delta.head<3>() = other.translation_ - translation_;
  delta.tail<3>() = rotation_log(Eigen::Quaterniond(other.rotation_ * rotation_.conjugate()));
  return delta;
}

Eigen::Quaterniond rotation_exp(const Eigen::Vector3d& phi) {
  const double angle = phi.norm();
  constexpr double kSmall = 1e-8;  // below, sin(x/2)/x is 1/2 to double precision
  const double scale = angle < kSmall ? 0.5 : std::sin(0.5 * angle) / angle;
  Eigen::Quaterniond result;
  result.w() = std::cos(0.5 * angle);
  result.vec() = scale * phi;
  return result.normalized();
}

Eigen::Vector3d rotation_log(const Eigen::Quaterniond& rotation) {
  const double sign = rotation.w() < 0.0 ? -1.0 : 1.0;
  const double sine = rotation.vec().norm();
  const double angle = 2.0 * std::atan2(sine, std::abs(rotation.w()));
  constexpr double kSmall = 1e-12;
  return sign * (sine < kSmall ? 2.0 : angle / sine) * rotation.vec();
}

Eigen::Matrix3d skew(const Eigen::Vector3d& a) {
  Eigen::Matrix3d result;
  result << 0.0, -a.z(), a.y(), a.z(), 0.0, -a.x(), -a.y(), a.x(), 0.0;
  return result;
}

}  // namespace cairn
