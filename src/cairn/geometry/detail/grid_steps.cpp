// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/geometry/detail/grid_steps.hpp"

#include <cstddef>
#include <vector>

#include "cairn/core/statistics.hpp"

namespace cairn::detail {

Eigen::Vector3d grid_steps(std::span<const Eigen::Vector3d> positions) {
  constexpr std::size_t kSample = 4096;
  const std::size_t stride = 1 + positions.size() / kSample;
  Eigen::Vector3d steps;
  std::vector<double> values;
  for (int axis = 0; axis < 3; ++axis) {
    values.clear();
    for (std::size_t i = 0; i < positions.size(); i += stride) values.push_back(positions[i][axis]);
    steps[axis] = common_step(values);
  }
  if ((steps.array() > 0.0).count() < 2) return Eigen::Vector3d::Zero();
  return steps;
}

}  // namespace cairn::detail
