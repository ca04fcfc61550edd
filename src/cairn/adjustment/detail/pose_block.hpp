// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>

#include <ceres/manifold.h>

#include "cairn/geometry/rigid3.hpp"

namespace cairn {

/// A pose as Ceres moves it: quaternion x y z w, then translation.
using PoseBlock = std::array<double, 7>;

PoseBlock to_block(const Rigid3& pose);
Rigid3 to_pose(const double* block);

/// Steps are Rigid3's left perturbations (δt, δφ). Cost functions give derivatives by those in the
/// first six columns of what Ceres takes for derivatives by the seven numbers, and zeros in the last;
/// with this Jacobian the product is right.
class PoseManifold final : public ceres::Manifold {
 public:
  int AmbientSize() const override { return 7; }
  int TangentSize() const override { return 6; }
  bool Plus(const double* x, const double* delta, double* x_plus_delta) const override;
  bool PlusJacobian(const double* x, double* jacobian) const override;
  bool Minus(const double* y, const double* x, double* y_minus_x) const override;
  bool MinusJacobian(const double* x, double* jacobian) const override;
};

}  // namespace cairn
