// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/evaluation/pose_error.hpp"

#include <numeric>

namespace cairn {

PoseError pose_error(const Rigid3& estimate, const Rigid3& truth,
                     std::span<const Eigen::Vector3d> source) {
  Eigen::Vector3d centroid = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& position : source) centroid += position;
  if (!source.empty()) centroid /= static_cast<double>(source.size());
  return {(estimate.inverse() * truth).angle(), (estimate * centroid - truth * centroid).norm()};
}

}  // namespace cairn
