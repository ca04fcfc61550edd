// SPDX-License-Identifier: BSD-3-Clause
#include <cmath>

#include "cairn/geometry/covariance.hpp"
#include "cairn/geometry/decompositions.hpp"
#include "cairn/registration/estimation/point_to_point.hpp"

namespace cairn {
namespace {

using Jacobian = Eigen::Matrix<double, 3, 6>;

// An eigenvalue of the information below this share of the largest counts as rounding.
constexpr double kOpen = 1e-9;

}  // namespace

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
