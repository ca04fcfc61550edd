// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/geometry/detail/central_part.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include "cairn/core/detail/selection.hpp"

namespace cairn {
namespace {

constexpr double kFar = 100.0;

// Distance from the median beyond which a point is a far outlier.
double reach_of(std::span<const Eigen::Vector3d> points, Eigen::Vector3d& middle) {
  std::vector<double> values(points.size());
  for (int axis = 0; axis < 3; ++axis) {
    std::transform(points.begin(), points.end(), values.begin(),
                   [&](const Eigen::Vector3d& point) { return point[axis]; });
    middle[axis] = detail::upper_median(values);
  }
  std::transform(points.begin(), points.end(), values.begin(),
                 [&](const Eigen::Vector3d& point) { return (point - middle).norm(); });
  return kFar * detail::upper_median(values);
}

}  // namespace

CentralPart central_part(std::span<const Eigen::Vector3d> points) {
  CentralPart part;
  if (points.empty()) return part;
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  const double reach = reach_of(points, middle);
  // If more than half of the points coincide, the median distance is 0 and no point counts as far.
  const auto is_central = [&](const Eigen::Vector3d& point) {
    return reach == 0.0 || (point - middle).norm() <= reach;
  };
  std::size_t count = 0;
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& point : points) {
    if (!is_central(point)) continue;
    sum += point;
    ++count;
  }
  part.centre = sum / static_cast<double>(count);
  double squares = 0.0;
  for (const Eigen::Vector3d& point : points) {
    if (is_central(point)) squares += (point - part.centre).squaredNorm();
  }
  part.radius = std::sqrt(squares / static_cast<double>(count));
  return part;
}

}  // namespace cairn
