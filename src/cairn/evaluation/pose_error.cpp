// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/evaluation/pose_error.hpp"

#include <cmath>

#include "cairn/geometry/detail/central_part.hpp"

namespace cairn {

PoseError pose_error(const Similarity3& estimate, const Similarity3& truth,
                     std::span<const Eigen::Vector3d> source) {
  const Eigen::Vector3d centre = central_part(source).centre;
  return {(estimate.rigid().inverse() * truth.rigid()).angle(),
          (estimate * centre - truth * centre).norm(),
          std::abs(std::log(estimate.scale() / truth.scale()))};
}

}  // namespace cairn
