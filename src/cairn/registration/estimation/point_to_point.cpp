// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/registration/estimation/point_to_point.hpp"

#include <vector>

#include <Eigen/SVD>

namespace cairn {
namespace {

// Singular values below this share of the largest are rounding, not extent: a cloud 1 m long and
// less than 0.1 mm thick counts as a line.
constexpr double kFlat = 1e-9;

Eigen::Matrix3d rotation_of(const Eigen::Matrix3d& correlation) {
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(correlation,
                                              Eigen::ComputeFullU | Eigen::ComputeFullV);
  const Eigen::Vector3d& s = svd.singularValues();
  if (!(s[0] > 0.0)) return Eigen::Matrix3d::Identity();
  if (s[1] <= kFlat * s[0]) {
    return Eigen::Quaterniond::FromTwoVectors(svd.matrixV().col(0), svd.matrixU().col(0))
        .toRotationMatrix();
  }
  const double sign = (svd.matrixU() * svd.matrixV().transpose()).determinant() < 0.0 ? -1.0 : 1.0;
  return svd.matrixU() * Eigen::Vector3d(1.0, 1.0, sign).asDiagonal() * svd.matrixV().transpose();
}

}  // namespace

Rigid3 closest_motion(std::span<const Eigen::Vector3d> from, std::span<const Eigen::Vector3d> to,
                      std::span<const double> weights) {
  const auto weight = [&](std::size_t i) { return weights.empty() ? 1.0 : weights[i]; };
  double total = 0.0;
  Eigen::Vector3d from_mean = Eigen::Vector3d::Zero();
  Eigen::Vector3d to_mean = Eigen::Vector3d::Zero();
  for (std::size_t i = 0; i < from.size(); ++i) {
    total += weight(i);
    from_mean += weight(i) * from[i];
    to_mean += weight(i) * to[i];
  }
  from_mean /= total;
  to_mean /= total;
  Eigen::Matrix3d correlation = Eigen::Matrix3d::Zero();
  for (std::size_t i = 0; i < from.size(); ++i) {
    correlation += weight(i) * (to[i] - to_mean) * (from[i] - from_mean).transpose();
  }
  const Eigen::Matrix3d rotation = rotation_of(correlation);
  return {rotation, to_mean - rotation * from_mean};
}

Rigid3 PointToPointEstimation::operator()(std::span<const Eigen::Vector3d> moved_source,
                                          std::span<const Match> matches) const {
  std::vector<Eigen::Vector3d> from;
  std::vector<Eigen::Vector3d> to;
  std::vector<double> weights;
  from.reserve(matches.size());
  to.reserve(matches.size());
  for (const Match& match : matches) {
    from.push_back(moved_source[match.source]);
    to.push_back(target_[match.target]);
    if (!source_weights_.empty()) weights.push_back(source_weights_[match.source]);
  }
  return closest_motion(from, to, weights);
}

}  // namespace cairn
