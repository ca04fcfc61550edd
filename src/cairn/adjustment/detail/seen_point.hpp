// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <span>

#include <Eigen/Core>

#include "cairn/geometry/rigid3.hpp"
#include "cairn/map/camera.hpp"

namespace cairn::detail {

/// Residuals of an observed point in standard deviations, with the derivative with respect to the point in
/// camera coordinates. Pixel and depth are separate blocks of two rows, because Ceres eliminates points
/// fast if all blocks have two rows. The second row of a depth block is zero.
struct SeenPoint {
  Eigen::Vector2d value = Eigen::Vector2d::Zero();
  Eigen::Matrix<double, 2, 3> by_x_in_camera = Eigen::Matrix<double, 2, 3>::Zero();
};

/// Residuals of a camera on a body, with the derivative with respect to the point in the body's
/// coordinates.
/// @param camera_from_body null if the body is the camera
/// @param see a function std::optional<SeenPoint>(const Eigen::Vector3d& x_in_camera)
template <class See>
std::optional<SeenPoint> seen_from_body(const Rigid3* camera_from_body,
                                        const Eigen::Vector3d& x_in_body, const See& see) {
  if (camera_from_body == nullptr) return see(x_in_body);
  std::optional<SeenPoint> seen = see(*camera_from_body * x_in_body);
  if (seen) seen->by_x_in_camera *= camera_from_body->rotation();
  return seen;
}

/// Residual of the point's projection, for any camera model.
/// @param parameters parameters of the camera
/// @return std::nullopt if the camera cannot see the point; see project()
std::optional<SeenPoint> seen_pixel(const CameraProjection& projection, const double* parameters,
                                    const Eigen::Vector2d& pixel, double sigma_px,
                                    const Eigen::Vector3d& x_in_camera);

/// Residual of the point's depth along the optical axis.
/// @return std::nullopt if the point is not in front of the camera
std::optional<SeenPoint> seen_depth(double depth, double sigma, const Eigen::Vector3d& x_in_camera);

/// Derivative of the point's pixel with respect to the camera's parameters, in their order.
/// @return std::nullopt if the camera cannot see the point
std::optional<Eigen::Matrix2Xd> pixel_by_parameters(const CameraProjection& projection,
                                                    std::span<const double> parameters,
                                                    const Eigen::Vector3d& x_in_camera);

}  // namespace cairn::detail
