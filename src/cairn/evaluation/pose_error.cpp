// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/evaluation/pose_error.hpp"

#include "cairn/geometry/centroid.hpp"

namespace cairn {

PoseError pose_error(const Rigid3& estimate, const Rigid3& truth,
                     std::span<const Eigen::Vector3d> source) {
  const Eigen::Vector3d centre = centroid(source);
  return {(estimate.inverse() * truth).angle(), (estimate * centre - truth * centre).norm()};
}

}  // namespace cairn
