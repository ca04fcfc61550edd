// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <span>

#include <Eigen/Core>

namespace cairn::detail {

/// Steps of the grid that positions lie on, e.g. of voxel centres or rounded numbers. The step of an axis is
/// common_step() of this coordinate of some thousands of positions; 0 if there is none. All steps are 0 if fewer than
/// two axes have one.
Eigen::Vector3d grid_steps(std::span<const Eigen::Vector3d> positions);

}  // namespace cairn::detail
