// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <span>

#include <Eigen/Core>

#include "cairn/map/camera.hpp"
#include "cairn/map/camera_projection.hpp"

namespace cairn {

/// Residuals of a point that a camera sees, in standard deviations, with the derivative by the point
/// in camera coordinates. Ceres eliminates points fast where every residual block has two rows: so pixel
/// and depth are blocks of their own, and the second row of a depth is zero.
struct SeenPoint {
  Eigen::Vector2d value = Eigen::Vector2d::Zero();
  Eigen::Matrix<double, 2, 3> by_x_in_camera = Eigen::Matrix<double, 2, 3>::Zero();
};

/// Where the point appears, against the pixel where it was seen; of any camera model.
/// @param parameters of the camera
/// @return std::nullopt if it is not in front of the camera
std::optional<SeenPoint> seen_pixel(const CameraProjection& projection, const double* parameters,
                                    const Eigen::Vector2d& pixel, double sigma_px,
                                    const Eigen::Vector3d& x_in_camera);

/// How far the point is along the optical axis, against the depth measured.
/// @return std::nullopt if it is not in front of the camera
std::optional<SeenPoint> seen_depth(double depth, double sigma, const Eigen::Vector3d& x_in_camera);

/// Derivative of the point's pixel by the camera's parameters, in their order; the point is in front of the
/// camera.
Eigen::Matrix2Xd pixel_by_parameters(const CameraProjection& projection,
                                     std::span<const double> parameters,
                                     const Eigen::Vector3d& x_in_camera);

}  // namespace cairn
