// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/evaluation/pose_error.hpp"

#include <algorithm>
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

bool fits_inverse(const Similarity3& estimate, const Similarity3& truth,
                  std::span<const Eigen::Vector3d> source) {
  const CentralPart part = central_part(source);
  // As if the landmarks lay alike in all directions.
  const auto displacement = [&](const Similarity3& other) {
    const double at_centre = (estimate * part.centre - other * part.centre).norm();
    return std::hypot(at_centre,
                      (estimate.linear() - other.linear()).norm() * part.radius / std::sqrt(3.0));
  };
  const double limit = 0.1 * estimate.scale() * part.radius;
  const double inverted = displacement(truth.inverse());
  return inverted < limit && displacement(truth) > std::max(limit, 5.0 * inverted);
}

}  // namespace cairn
