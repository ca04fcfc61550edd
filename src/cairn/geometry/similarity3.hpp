// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <span>
#include <vector>

#include "cairn/geometry/rigid3.hpp"

namespace cairn {

using Vector7d = Eigen::Matrix<double, 7, 1, Eigen::DontAlign>;
using Matrix7d = Eigen::Matrix<double, 7, 7, Eigen::DontAlign>;

/// A scale, a rotation and a translation, Sim(3): `x_in_a = s·R·x_in_b + t`.
class Similarity3 {
 public:
  /// The identity.
  Similarity3() = default;
  /// @param scale positive and finite
  Similarity3(double scale, const Rigid3& rigid);
  /// A rigid motion is a similarity of scale 1.
  Similarity3(const Rigid3& rigid) : rigid_(rigid) {}  // NOLINT(google-explicit-constructor)

  /// From an external homogeneous matrix with the upper left block s·R; the scale is 1 if the block
  /// is a rotation within `tolerance`.
  /// @throws Error (misuse) if the block's determinant is not positive, or as Rigid3::from_matrix
  static Similarity3 from_matrix(const Matrix4d& matrix, double tolerance = 1e-4);

  double scale() const { return scale_; }
  const Rigid3& rigid() const { return rigid_; }
  /// s·R.
  Eigen::Matrix3d linear() const { return scale_ * rigid_.rotation(); }
  const Eigen::Vector3d& translation() const { return rigid_.translation(); }
  Matrix4d matrix() const;

  Similarity3 inverse() const;
  Similarity3 operator*(const Similarity3& b_from_c) const;
  Eigen::Vector3d operator*(const Eigen::Vector3d& x_in_b) const;

 private:
  double scale_ = 1.0;
  Rigid3 rigid_;
};

/// The points transformed by `pose`.
inline std::vector<Eigen::Vector3d> moved_points(std::span<const Eigen::Vector3d> points,
                                                 const Similarity3& pose) {
  const Eigen::Matrix3d linear = pose.linear();
  std::vector<Eigen::Vector3d> moved;
  moved.reserve(points.size());
  for (const Eigen::Vector3d& point : points) {
    moved.emplace_back(linear * point + pose.translation());
  }
  return moved;
}

}  // namespace cairn
