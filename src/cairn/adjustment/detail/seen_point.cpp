// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/adjustment/detail/seen_point.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

namespace cairn::detail {
namespace {

// `x_in_camera` in front of the camera.
Eigen::Vector2d pixel_of(const CameraProjection& projection, const double* parameters,
                         const Eigen::Vector3d& x_in_camera) {
  const Pixel at = *projection(parameters, x_in_camera);
  return {at.u, at.v};
}

}  // namespace

std::optional<SeenPoint> seen_pixel(const CameraProjection& projection, const double* parameters,
                                    const Eigen::Vector2d& pixel, double sigma_px,
                                    const Eigen::Vector3d& x_in_camera) {
  if (!(x_in_camera.z() > 0.0)) return std::nullopt;
  const double inverse = 1.0 / x_in_camera.z();
  const double x = x_in_camera.x() * inverse;
  const double y = x_in_camera.y() * inverse;
  if (!std::isfinite(x) || !std::isfinite(y)) return std::nullopt;
  SeenPoint seen;
  const auto at = [&](double u, double v) { return pixel_of(projection, parameters, {u, v, 1.0}); };
  seen.value = (at(x, y) - pixel) / sigma_px;
  // Models differ in the distortion of (x, y) only, whose derivative is numerical.
  const double step = 1e-6 * std::max({1.0, std::abs(x), std::abs(y)});
  Eigen::Matrix2d by_normalised;
  by_normalised << at(x + step, y) - at(x - step, y), at(x, y + step) - at(x, y - step);
  by_normalised /= 2.0 * step * sigma_px;
  Eigen::Matrix<double, 2, 3> normalised_by_x;
  normalised_by_x << inverse, 0.0, -x * inverse, 0.0, inverse, -y * inverse;
  seen.by_x_in_camera = by_normalised * normalised_by_x;
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

Eigen::Matrix2Xd pixel_by_parameters(const CameraProjection& projection,
                                     std::span<const double> parameters,
                                     const Eigen::Vector3d& x_in_camera) {
  std::vector<double> moved(parameters.begin(), parameters.end());
  Eigen::Matrix2Xd result(2, static_cast<Eigen::Index>(moved.size()));
  for (std::size_t i = 0; i < moved.size(); ++i) {
    const double value = moved[i];
    const double step = 1e-6 * std::max(1.0, std::abs(value));
    moved[i] = value + step;
    const Eigen::Vector2d above = pixel_of(projection, moved.data(), x_in_camera);
    moved[i] = value - step;
    const Eigen::Vector2d below = pixel_of(projection, moved.data(), x_in_camera);
    moved[i] = value;
    result.col(static_cast<Eigen::Index>(i)) = (above - below) / (2.0 * step);
  }
  return result;
}

}  // namespace cairn::detail
