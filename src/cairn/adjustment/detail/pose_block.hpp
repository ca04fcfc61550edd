// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>

#include <ceres/manifold.h>

#include "cairn/geometry/rigid3.hpp"

namespace cairn::detail {

/// A pose as Ceres parameters: quaternion x y z w, then translation.
using PoseBlock = std::array<double, 7>;

PoseBlock to_block(const Rigid3& pose);
Rigid3 to_pose(const double* block);

/// Steps are Rigid3's left perturbations (δt, δφ). A cost function puts the derivatives with respect to the
/// step into the first six columns of the Jacobian that Ceres expects for the seven numbers, and zeros into
/// the last column. The product with this manifold's Jacobian is then right.
class PoseManifold final : public ceres::Manifold {
 public:
  int AmbientSize() const override { return 7; }
  int TangentSize() const override { return 6; }
  bool Plus(const double* x, const double* delta, double* x_plus_delta) const override;
  bool PlusJacobian(const double* x, double* jacobian) const override;
  bool Minus(const double* y, const double* x, double* y_minus_x) const override;
  bool MinusJacobian(const double* x, double* jacobian) const override;
};

}  // namespace cairn::detail
