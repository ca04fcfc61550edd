// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include <Eigen/Core>

namespace cairn {

/// Parts some points into groups of about equal size, close together: halves of halves, each cut at the
/// median of the longest edge of its bounding box.
/// @param count a power of two
/// @return the group of each point, below count
std::vector<std::size_t> spatial_groups(std::span<const Eigen::Vector3d> points, std::size_t count);

}  // namespace cairn
