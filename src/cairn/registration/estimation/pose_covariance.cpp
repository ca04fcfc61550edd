// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/registration/estimation/pose_covariance.hpp"

#include <cmath>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

#include "cairn/geometry/covariance.hpp"

namespace cairn {
namespace {

using Jacobian = Eigen::Matrix<double, 3, 6>;

// An eigenvalue of the information below this share of the largest is rounding.
constexpr double kOpen = 1e-9;

}  // namespace

PoseUncertainty pose_uncertainty(const Rigid3& target_from_source, const PoseEvidence& evidence) {
  PoseUncertainty result;
  const double length = evidence.length;
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, 6, 6>> eigen(evidence.information);
  for (int i = 0; i < 6; ++i) {
    if (eigen.eigenvalues()[i] > kOpen * eigen.eigenvalues()[5]) continue;
    const Vector6d direction = eigen.eigenvectors().col(i);
    result.unobservable.push_back({direction.head<3>(), direction.tail<3>() / length});
  }
  if (!result.unobservable.empty()) return result;

  const Matrix6d inverse = evidence.information.inverse();
  const Matrix6d about_pivot =
      evidence.count / (evidence.count - 2.0) * inverse * evidence.scatter * inverse;
  // δt = δpivot - δφ × (pivot - t), and undo the scaling of the rotation.
  Matrix6d to_pose = Matrix6d::Identity();
  to_pose.topRightCorner<3, 3>() = skew(evidence.pivot - target_from_source.translation()) / length;
  to_pose.bottomRightCorner<3, 3>() /= length;
  result.covariance = propagated_covariance(to_pose, about_pivot);
  return result;
}

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

  PoseEvidence evidence;
  evidence.pivot = centroid;
  evidence.length = radius > 0.0 ? radius : 1.0;
  evidence.count = static_cast<double>(matches.size());
  for (const Match& match : matches) {
    const Eigen::Vector3d arm = moved_source[match.source] - centroid;
    const Eigen::Vector3d residual = moved_source[match.source] - target[match.target];
    Jacobian jacobian;
    jacobian << Eigen::Matrix3d::Identity(), -skew(arm) / evidence.length;
    const Vector6d gradient = weight(match) * jacobian.transpose() * residual;
    evidence.information += weight(match) * jacobian.transpose() * jacobian;
    evidence.scatter += gradient * gradient.transpose();
  }
  return pose_uncertainty(target_from_source, evidence);
}

}  // namespace cairn
