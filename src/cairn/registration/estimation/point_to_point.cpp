// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/registration/estimation/point_to_point.hpp"

#include <cstddef>
#include <utility>

#include "cairn/geometry/decompositions.hpp"

namespace cairn {
namespace {

// Singular values below this share of the largest count as rounding: a cloud 1 m long and less than 0.03 mm
// thick is a line.
constexpr double kFlat = 1e-9;

Eigen::Matrix3d rotation_of(const Eigen::Matrix3d& correlation) {
  const SingularValues3 svd = singular_values(correlation);
  const Eigen::Vector3d& s = svd.values;
  if (!(s[0] > 0.0)) return Eigen::Matrix3d::Identity();
  if (s[1] <= kFlat * s[0]) {
    return rotation_between(svd.v.col(0), svd.u.col(0)).toRotationMatrix();
  }
  return nearest_rotation(svd);
}

// `pair(i)` gives from and to, `weight(i)` the weight of one of `count` pairs.
template <class Pair, class Weight>
Rigid3 closest_motion_of(std::size_t count, const Pair& pair, const Weight& weight) {
  double total = 0.0;
  Eigen::Vector3d from_mean = Eigen::Vector3d::Zero();
  Eigen::Vector3d to_mean = Eigen::Vector3d::Zero();
  for (std::size_t i = 0; i < count; ++i) {
    const auto& [from, to] = pair(i);
    total += weight(i);
    from_mean += weight(i) * from;
    to_mean += weight(i) * to;
  }
  from_mean /= total;
  to_mean /= total;
  // One vector per column, which stays in registers; a single matrix would be summed in memory.
  Eigen::Vector3d x = Eigen::Vector3d::Zero();
  Eigen::Vector3d y = Eigen::Vector3d::Zero();
  Eigen::Vector3d z = Eigen::Vector3d::Zero();
  for (std::size_t i = 0; i < count; ++i) {
    const auto& [from, to] = pair(i);
    const Eigen::Vector3d arm = weight(i) * (to - to_mean);
    x += arm * (from.x() - from_mean.x());
    y += arm * (from.y() - from_mean.y());
    z += arm * (from.z() - from_mean.z());
  }
  Eigen::Matrix3d correlation;
  correlation << x, y, z;
  const Eigen::Matrix3d rotation = rotation_of(correlation);
  return {rotation, to_mean - rotation * from_mean};
}

using PointPair = std::pair<const Eigen::Vector3d&, const Eigen::Vector3d&>;

constexpr double equal_weight(std::size_t /*pair*/) {
  return 1.0;
}

}  // namespace

Rigid3 closest_motion(std::span<const Eigen::Vector3d> from, std::span<const Eigen::Vector3d> to,
                      std::span<const double> weights) {
  const auto pair = [&](std::size_t i) { return PointPair(from[i], to[i]); };
  if (weights.empty()) return closest_motion_of(from.size(), pair, equal_weight);
  return closest_motion_of(from.size(), pair, [&](std::size_t i) { return weights[i]; });
}

Rigid3 PointToPointEstimation::operator()(std::span<const Eigen::Vector3d> moved_source,
                                          std::span<const Match> matches) const {
  const auto pair = [&](std::size_t i) {
    return PointPair(moved_source[matches[i].source], target_[matches[i].target]);
  };
  if (source_weights_.empty()) return closest_motion_of(matches.size(), pair, equal_weight);
  return closest_motion_of(matches.size(), pair,
                           [&](std::size_t i) { return source_weights_[matches[i].source]; });
}

}  // namespace cairn
