// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/adjustment/detail/seen_point.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include <Eigen/Geometry>

namespace cairn::detail {

std::optional<SeenPoint> seen_pixel(const CameraProjection& projection, const double* parameters,
                                    const Eigen::Vector2d& pixel, double sigma_px,
                                    const Eigen::Vector3d& x_in_camera) {
  const double distance = x_in_camera.norm();
  if (!(distance > 0.0) || !std::isfinite(distance)) return std::nullopt;
  const Eigen::Vector3d ray = x_in_camera / distance;
  const auto at = projection(parameters, ray);
  if (!at) return std::nullopt;
  SeenPoint seen;
  seen.value = projection.difference(parameters, *at, {pixel.x(), pixel.y()}) / sigma_px;
  // The pixel depends on the direction only, whose derivative is numerical, across the ray.
  constexpr double kStep = 1e-6;
  Eigen::Matrix<double, 3, 2> across;
  across.col(0) = ray.unitOrthogonal();
  across.col(1) = ray.cross(across.col(0));
  Eigen::Matrix2d by_step;
  for (int i = 0; i < 2; ++i) {
    const auto above = projection(parameters, ray + kStep * across.col(i));
    const auto below = projection(parameters, ray - kStep * across.col(i));
    if (!above || !below) return std::nullopt;
    by_step.col(i) = projection.difference(parameters, *above, *below) / (2.0 * kStep * sigma_px);
  }
  seen.by_x_in_camera = by_step * across.transpose() / distance;
  if (!seen.value.allFinite() || !seen.by_x_in_camera.allFinite()) return std::nullopt;
  return seen;
}

std::optional<SeenPoint> seen_depth(double depth, double sigma,
                                    const Eigen::Vector3d& x_in_camera) {
  if (!(x_in_camera.z() > 0.0)) return std::nullopt;
  SeenPoint seen;
  seen.value.x() = (x_in_camera.z() - depth) / sigma;
  seen.by_x_in_camera(0, 2) = 1.0 / sigma;
  return seen;
}

std::optional<Eigen::Matrix2Xd> pixel_by_parameters(const CameraProjection& projection,
                                                    std::span<const double> parameters,
                                                    const Eigen::Vector3d& x_in_camera) {
  std::vector<double> moved(parameters.begin(), parameters.end());
  Eigen::Matrix2Xd result(2, static_cast<Eigen::Index>(moved.size()));
  for (std::size_t i = 0; i < moved.size(); ++i) {
    const double value = moved[i];
    const double step = 1e-6 * std::max(1.0, std::abs(value));
    moved[i] = value + step;
    const auto above = projection(moved.data(), x_in_camera);
    moved[i] = value - step;
    const auto below = projection(moved.data(), x_in_camera);
    moved[i] = value;
    if (!above || !below) return std::nullopt;
    result.col(static_cast<Eigen::Index>(i)) =
        projection.difference(moved.data(), *above, *below) / (2.0 * step);
  }
  return result;
}

}  // namespace cairn::detail
