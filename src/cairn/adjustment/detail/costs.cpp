// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/adjustment/detail/costs.hpp"

#include <cmath>

#include <Eigen/Cholesky>
#include <Eigen/Geometry>

#include "cairn/core/error.hpp"

namespace cairn::detail {
namespace {

using Matrix6 = Eigen::Matrix<double, 6, 6>;
using Rows67 = Eigen::Matrix<double, 6, 7, Eigen::RowMajor>;

// W with Wᵀ·W = covariance⁻¹.
Matrix6 whitening_of(const Matrix6d& covariance) {
  const Eigen::LLT<Matrix6> factor{Matrix6(covariance)};
  refuse_if(factor.info() != Eigen::Success, "covariance of a pose", "is not positive definite",
            "a positive definite matrix");
  return factor.matrixL().solve(Matrix6::Identity().eval());
}

// d log(Exp(ε)·R)/dε at ε = 0, for R = Exp(φ): the inverse of the left Jacobian of SO(3).
Eigen::Matrix3d log_derivative(const Eigen::Vector3d& phi) {
  const double angle = phi.norm();
  const Eigen::Matrix3d cross = skew(phi);
  constexpr double kSmall = 1e-4;  // below, the series is exact to double precision
  const double factor =
      angle < kSmall ? 1.0 / 12.0 : (1.0 - 0.5 * angle / std::tan(0.5 * angle)) / (angle * angle);
  return Eigen::Matrix3d::Identity() - 0.5 * cross + factor * cross * cross;
}

void set_rows(double* jacobian, const Matrix6& by_step) {
  Eigen::Map<Rows67> rows(jacobian);
  rows.leftCols<6>() = by_step;
  rows.col(6).setZero();
}

}  // namespace

CalibrationCost::CalibrationCost(const Camera& camera, const Eigen::Vector2d& pixel,
                                 double sigma_px, const Rigid3* camera_from_body)
    : projection_(camera), pixel_(pixel), sigma_px_(sigma_px), camera_from_body_(camera_from_body) {
  set_num_residuals(2);
  *mutable_parameter_block_sizes() = {7, 3, static_cast<int>(camera.parameters.size())};
}

bool CalibrationCost::Evaluate(const double* const* parameters, double* residuals,
                               double** jacobians) const {
  const PointCost pixel_cost([&](const Eigen::Vector3d& x_in_body) {
    return seen_from_body(camera_from_body_, x_in_body, [&](const Eigen::Vector3d& x_in_camera) {
      return seen_pixel(projection_, parameters[2], pixel_, sigma_px_, x_in_camera);
    });
  });
  if (!pixel_cost.Evaluate(parameters, residuals, jacobians)) return false;
  if (jacobians == nullptr || jacobians[2] == nullptr) return true;
  const Rigid3 pose = to_pose(parameters[0]);
  Eigen::Vector3d x_in_camera =
      pose.inverse() * Eigen::Vector3d(parameters[1][0], parameters[1][1], parameters[1][2]);
  if (camera_from_body_ != nullptr) x_in_camera = *camera_from_body_ * x_in_camera;
  const auto count = static_cast<std::size_t>(parameter_block_sizes()[2]);
  const auto by_parameters = pixel_by_parameters(projection_, {parameters[2], count}, x_in_camera);
  if (!by_parameters) return false;
  Eigen::Map<Eigen::Matrix<double, 2, Eigen::Dynamic, Eigen::RowMajor>>(
      jacobians[2], 2, by_parameters->cols()) = *by_parameters / sigma_px_;
  return true;
}

RelativePoseCost::RelativePoseCost(const Rigid3& a_from_b, const Matrix6d& covariance)
    : measured_(a_from_b), whitening_(whitening_of(covariance)) {}

bool RelativePoseCost::Evaluate(const double* const* parameters, double* residuals,
                                double** jacobians) const {
  const Rigid3 a = to_pose(parameters[0]);
  const Rigid3 b = to_pose(parameters[1]);
  const Vector6d error = measured_.difference_to(a.inverse() * b);
  Eigen::Map<Eigen::Matrix<double, 6, 1>>{residuals} = whitening_ * error;
  if (jacobians == nullptr) return true;
  const Eigen::Matrix3d a_from_world = a.rotation().transpose();
  const Eigen::Matrix3d by_rotation = log_derivative(error.tail<3>()) * a_from_world;
  Matrix6 by_a = Matrix6::Zero();
  by_a.topLeftCorner<3, 3>() = -a_from_world;
  by_a.topRightCorner<3, 3>() = a_from_world * skew(b.translation() - a.translation());
  by_a.bottomRightCorner<3, 3>() = -by_rotation;
  Matrix6 by_b = Matrix6::Zero();
  by_b.topLeftCorner<3, 3>() = a_from_world;
  by_b.bottomRightCorner<3, 3>() = by_rotation;
  if (jacobians[0] != nullptr) set_rows(jacobians[0], whitening_ * by_a);
  if (jacobians[1] != nullptr) set_rows(jacobians[1], whitening_ * by_b);
  return true;
}

PosePriorCost::PosePriorCost(const Rigid3& pose, const Matrix6d& covariance)
    : expected_(pose), whitening_(whitening_of(covariance)) {}

bool PosePriorCost::Evaluate(const double* const* parameters, double* residuals,
                             double** jacobians) const {
  const Vector6d error = expected_.difference_to(to_pose(parameters[0]));
  Eigen::Map<Eigen::Matrix<double, 6, 1>>{residuals} = whitening_ * error;
  if (jacobians == nullptr || jacobians[0] == nullptr) return true;
  Matrix6 by_pose = Matrix6::Identity();
  by_pose.bottomRightCorner<3, 3>() = log_derivative(error.tail<3>());
  set_rows(jacobians[0], whitening_ * by_pose);
  return true;
}

}  // namespace cairn::detail
