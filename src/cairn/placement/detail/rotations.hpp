// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <vector>

#include <Eigen/Geometry>

namespace cairn {

/// Rotations spread evenly over all of SO(3), without chance: super-Fibonacci spirals (Alexa, CVPR
/// 2022). n of them leave no rotation farther than about 4.5 rad / n^(1/3) from the nearest.
std::vector<Eigen::Quaterniond> all_rotations(std::size_t count);

/// Rotations that take direction `from` to direction `to`, turned about it in even steps.
std::vector<Eigen::Quaterniond> rotations_about(const Eigen::Vector3d& from,
                                                const Eigen::Vector3d& to, std::size_t count);

}  // namespace cairn
