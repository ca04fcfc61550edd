// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include <Eigen/Core>

namespace cairn::detail {

/// Divides points into compact groups of about equal size, by repeated halving at the median of the longest
/// edge of the bounding box.
/// @param count a power of two
/// @return group of each point, less than `count`
std::vector<std::size_t> spatial_groups(std::span<const Eigen::Vector3d> points, std::size_t count);

}  // namespace cairn::detail
