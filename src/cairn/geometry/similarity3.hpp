// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "cairn/geometry/rigid3.hpp"

namespace cairn {

/// A scale, a rotation and a translation, Sim(3): `x_in_a = s·R·x_in_b + t`.
class Similarity3 {
 public:
  /// The identity.
  Similarity3() = default;
  /// @param scale positive and finite
  Similarity3(double scale, const Rigid3& rigid);

  double scale() const { return scale_; }
  const Rigid3& rigid() const { return rigid_; }
  Matrix4d matrix() const;

  Similarity3 inverse() const;
  Similarity3 operator*(const Similarity3& b_from_c) const;
  Eigen::Vector3d operator*(const Eigen::Vector3d& x_in_b) const;

 private:
  double scale_ = 1.0;
  Rigid3 rigid_;
};

}  // namespace cairn
