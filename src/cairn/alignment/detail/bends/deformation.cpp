// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/alignment/detail/bends/deformation.hpp"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>
#include <Eigen/Geometry>

#include "cairn/geometry/decompositions.hpp"
#include "cairn/geometry/detail/pose_distance.hpp"

namespace cairn::detail {
namespace {

constexpr Eigen::Index kTerms = Deformation::kTerms;
using Terms = Eigen::Matrix<double, kTerms, 1>;

constexpr double kFarthest = 2.0;  // in radii: the end of the region
// Standard deviations of the coefficients of first and second degree, and of third, in radii.
constexpr double kPrior = 0.1;
constexpr double kCubicPrior = 0.05;
constexpr double kWidest = 0.1;     // first width of the loss, in radii
constexpr double kNarrowing = 0.7;  // of the width, from step to step
constexpr double kWidth = 4.0;      // last width, in deviations
constexpr int kSteps = 20;
constexpr double kLeastDeviation = 1e-4;  // in radii
constexpr double kFewest = 20.0;          // least sum of weights
constexpr double kInlier = 0.25;          // least weight

// Coordinates in radii; those beyond the end of the region are moved back to it, along the ray from
// the centre.
Eigen::Vector3d within(const Eigen::Vector3d& x) {
  const double length = x.norm();
  return length <= kFarthest ? x : Eigen::Vector3d(kFarthest / length * x);
}

Eigen::Vector3d rotated(const Eigen::Vector3d& x) {
  return {x.y(), x.z(), x.x()};
}

Terms terms(const Eigen::Vector3d& x) {
  const Eigen::Vector3d next = rotated(x);
  const Eigen::Vector3d squares = x.cwiseProduct(x);
  Terms result;
  result << 1.0, x, squares, x.cwiseProduct(next), squares.cwiseProduct(x),
      squares.cwiseProduct(next), x.cwiseProduct(next.cwiseProduct(next)), x.prod();
  return result;
}

// Derivative of the terms with respect to the coordinates.
Eigen::Matrix<double, kTerms, 3> derivative_of_terms(const Eigen::Vector3d& x) {
  const Eigen::Vector3d next = rotated(x);
  const Eigen::Matrix3d of_x = Eigen::Matrix3d::Identity();
  Eigen::Matrix3d of_next;
  of_next << 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0;
  const auto rows = [](const Eigen::Vector3d& factors, const Eigen::Matrix3d& matrix) {
    return Eigen::Matrix3d(factors.asDiagonal() * matrix);
  };
  const Eigen::Vector3d squares = x.cwiseProduct(x);
  const Eigen::Vector3d products = x.cwiseProduct(next);
  Eigen::Matrix<double, kTerms, 3> result;
  result << Eigen::RowVector3d::Zero(), of_x, rows(2.0 * x, of_x),
      rows(next, of_x) + rows(x, of_next), rows(3.0 * squares, of_x),
      rows(2.0 * products, of_x) + rows(squares, of_next),
      rows(next.cwiseProduct(next), of_x) + rows(2.0 * products, of_next),
      Eigen::RowVector3d(x.y() * x.z(), x.z() * x.x(), x.x() * x.y());
  return result;
}

// Inverse variances of the coefficients in the prior. The translation has no prior.
Terms prior_information() {
  constexpr Eigen::Index kCubic = 10;
  Terms result = Terms::Constant(1.0 / (kPrior * kPrior));
  result[0] = 0.0;
  result.tail<kCubic>().setConstant(1.0 / (kCubicPrior * kCubicPrior));
  return result;
}

}  // namespace

Eigen::Vector3d Deformation::operator()(const Eigen::Vector3d& x) const {
  return x + radius_ * (coefficients_ * terms(within((x - centre_) / radius_)));
}

Eigen::Matrix3d Deformation::derivative(const Eigen::Vector3d& x) const {
  const Eigen::Vector3d place = (x - centre_) / radius_;
  if (place.norm() > kFarthest) return Eigen::Matrix3d::Identity();
  return Eigen::Matrix3d::Identity() + coefficients_ * derivative_of_terms(place);
}

bool Deformation::folds(const Eigen::Vector3d& x) const {
  return !(derivative(x).determinant() > 0.0);
}

Similarity3 Deformation::near(const Eigen::Vector3d& x) const {
  const Eigen::Vector3d there = (*this)(x);
  const Eigen::Matrix3d linear = derivative(x);
  if (!(linear.determinant() > 0.0)) return Rigid3(Eigen::Quaterniond::Identity(), there - x);
  const SingularValues3 svd = singular_values(linear);
  const Eigen::Matrix3d turn = svd.u * svd.v.transpose();
  const double scale = std::cbrt(svd.values.prod());
  return {scale, Rigid3(Eigen::Quaterniond(turn), there - scale * (turn * x))};
}

std::optional<DeformationFit> fit_deformation(std::span<const Eigen::Vector3d> from,
                                              std::span<const Eigen::Vector3d> to,
                                              std::span<const Eigen::Vector3d> region) {
  if (static_cast<double>(from.size()) < kFewest) return std::nullopt;
  const PoseDistance extent = PoseDistance::of(region);
  if (!(extent.radius > 0.0)) return std::nullopt;
  const auto count = static_cast<Eigen::Index>(from.size());
  Eigen::MatrixXd rows(count, kTerms);
  Eigen::MatrixX3d displacements(count, 3);
  for (Eigen::Index i = 0; i < count; ++i) {
    const auto index = static_cast<std::size_t>(i);
    rows.row(i) = terms(within((from[index] - extent.centroid) / extent.radius));
    displacements.row(i) = (to[index] - from[index]) / extent.radius;
  }
  const Terms prior = prior_information();
  Deformation::Coefficients coefficients = Deformation::Coefficients::Zero();
  Eigen::VectorXd weights(count);
  double width = kWidest;
  double deviation = kWidest;
  for (int step = 0; step < kSteps; ++step) {
    const Eigen::VectorXd squares =
        (displacements - rows * coefficients.transpose()).rowwise().squaredNorm();
    weights = (1.0 + squares.array() / (width * width)).square().inverse();
    if (weights.sum() < kFewest) return std::nullopt;
    deviation = std::max(std::sqrt(weights.dot(squares) / weights.sum() / 3.0), kLeastDeviation);
    Eigen::Matrix<double, kTerms, kTerms> normal = rows.transpose() * weights.asDiagonal() * rows;
    normal.diagonal() += deviation * deviation * prior;
    coefficients =
        normal.ldlt().solve(rows.transpose() * weights.asDiagonal() * displacements).transpose();
    width = std::min(width, std::max(kNarrowing * width, kWidth * deviation));
  }
  DeformationFit fit;
  fit.deformation = Deformation(extent.centroid, extent.radius, coefficients);
  fit.deviation = deviation * extent.radius;
  for (Eigen::Index i = 0; i < count; ++i) {
    if (weights[i] >= kInlier) fit.inliers.push_back(static_cast<std::size_t>(i));
  }
  return fit;
}

}  // namespace cairn::detail
