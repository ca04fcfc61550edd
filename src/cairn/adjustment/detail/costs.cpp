// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/adjustment/detail/costs.hpp"

#include <Eigen/Geometry>

namespace cairn::detail {

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

}  // namespace cairn::detail
