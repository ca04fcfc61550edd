// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <span>

#include <Eigen/Core>

namespace cairn::detail {

/// Steps of the grid that positions lie on, such as voxel centres or rounded numbers: common_step() of each coordinate of
/// some thousands of them; 0 if there is none. All 0 if fewer than two coordinates have a step.
Eigen::Vector3d grid_steps(std::span<const Eigen::Vector3d> positions);

}  // namespace cairn::detail
