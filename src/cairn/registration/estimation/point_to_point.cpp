// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/registration/estimation/point_to_point.hpp"

#include <cmath>
#include <cstddef>
#include <utility>

#include "cairn/geometry/covariance.hpp"
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
  if (s[1] <= kFlat * s[0]) return rotation_between(svd.v.col(0), svd.u.col(0)).toRotationMatrix();
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

using Jacobian = Eigen::Matrix<double, 3, 6>;

// An eigenvalue of the information below this share of the largest counts as rounding.
constexpr double kOpen = 1e-9;

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

template <int kFreedoms>
PoseUncertainty pose_uncertainty(const Similarity3& target_from_source,
                                 const PoseEvidence<kFreedoms>& evidence) {
  using Matrix = typename PoseEvidence<kFreedoms>::Matrix;
  PoseUncertainty result;
  const double length = evidence.length;
  const SymmetricEigen<kFreedoms> information = symmetric_eigen<kFreedoms>(evidence.information);
  for (int i = 0; i < kFreedoms; ++i) {
    if (information.values[i] > kOpen * information.values[kFreedoms - 1]) continue;
    result.unobservable.push_back(open_direction<kFreedoms>(information.vectors.col(i), length));
  }
  if (!result.unobservable.empty()) return result;

  const Matrix inverse = information.vectors * information.values.cwiseInverse().asDiagonal() *
                         information.vectors.transpose();
  const Matrix about_pivot = inverse * evidence.scatter * inverse;
  const SymmetricEigen<kFreedoms> spread = symmetric_eigen<kFreedoms>(about_pivot);
  for (int i = 0; i < kFreedoms; ++i) {
    if (!(spread.values[i] > evidence.reach * evidence.reach)) continue;
    result.unobservable.push_back(open_direction<kFreedoms>(spread.vectors.col(i), length));
  }
  if (!result.unobservable.empty()) return result;

  // δt = δpivot - (δφ × (pivot - t) + δlog s·(pivot - t)), and undo the scaling of the rotation.
  const Eigen::Vector3d arm = evidence.pivot - target_from_source.translation();
  Matrix to_pose = Matrix::Identity();
  to_pose.template block<3, 3>(0, 3) = skew(arm) / length;
  to_pose.template block<3, 3>(3, 3) /= length;
  if constexpr (kFreedoms == 7) {
    to_pose.template block<3, 1>(0, 6) = -arm / length;
    to_pose(6, 6) /= length;
  }
  const Matrix covariance = propagated_covariance(to_pose, about_pivot);
  result.covariance = covariance.template topLeftCorner<6, 6>();
  if constexpr (kFreedoms == 7) result.covariance_with_scale = covariance;
  return result;
}

template PoseUncertainty pose_uncertainty(const Similarity3&, const PoseEvidence<6>&);
template PoseUncertainty pose_uncertainty(const Similarity3&, const PoseEvidence<7>&);

PoseUncertainty pose_uncertainty(const Rigid3& target_from_source,
                                 std::span<const Eigen::Vector3d> moved_source,
                                 std::span<const Eigen::Vector3d> target,
                                 std::span<const Match> matches,
                                 std::span<const double> source_weights) {
  PoseUncertainty result;
  if (matches.size() < kFewestMatches) return result;
  const auto weight = [&](const Match& match) {
    return source_weights.empty() ? 1.0 : source_weights[match.source];
  };
  Eigen::Vector3d centroid = Eigen::Vector3d::Zero();
  double total = 0.0;
  for (const Match& match : matches) {
    centroid += weight(match) * moved_source[match.source];
    total += weight(match);
  }
  if (!(total > 0.0)) return result;
  centroid /= total;
  double radius = 0.0;
  for (const Match& match : matches) {
    radius += weight(match) * (moved_source[match.source] - centroid).squaredNorm();
  }
  radius = std::sqrt(radius / total);

  PoseEvidence<6> evidence;
  evidence.pivot = centroid;
  evidence.length = radius > 0.0 ? radius : 1.0;
  for (const Match& match : matches) {
    const Eigen::Vector3d arm = moved_source[match.source] - centroid;
    const Eigen::Vector3d residual = moved_source[match.source] - target[match.target];
    Jacobian jacobian;
    jacobian << Eigen::Matrix3d::Identity(), -skew(arm) / evidence.length;
    const Vector6d gradient = weight(match) * jacobian.transpose() * residual;
    evidence.information += weight(match) * jacobian.transpose() * jacobian;
    evidence.scatter += gradient * gradient.transpose();
  }
  const auto count = static_cast<double>(matches.size());
  evidence.scatter *= count / (count - 2.0);
  return pose_uncertainty(Similarity3(target_from_source), evidence);
}

}  // namespace cairn
