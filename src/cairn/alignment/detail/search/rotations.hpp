// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <vector>

#include <Eigen/Geometry>

namespace cairn {

/// Evenly spread, deterministic rotations over SO(3): super-Fibonacci spirals (Alexa, CVPR 2022). With n of
/// them, every rotation is within about 4.5 rad / n^(1/3) of the nearest.
std::vector<Eigen::Quaterniond> all_rotations(std::size_t count);

/// Rotations from direction `from` to direction `to`, at even steps about it.
std::vector<Eigen::Quaterniond> rotations_about(const Eigen::Vector3d& from,
                                                const Eigen::Vector3d& to, std::size_t count);

}  // namespace cairn
