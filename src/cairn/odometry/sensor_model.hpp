// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "cairn/adjustment/pose_derivative.hpp"
#include "cairn/geometry/rigid3.hpp"
#include "cairn/odometry/features.hpp"

namespace cairn {

/// How far an RGB-D camera's measurements are off, as standard deviations.
struct SensorNoise {
  /// Of where a corner is found, in pixels of its pyramid level; positive.
  double pixel = 0.9;
  /// The same, for where the landmark's patch was found, relative to where it was cut; positive.
  double aligned_pixel = 0.4;
  /// Of depth z: floor + quadratic·z², metres for z in metres (structured light: Khoshelham and
  /// Elberink, Sensors 2012). Positive; not negative.
  double depth_floor_m = 0.001;
  double depth_quadratic = 0.002;

  /// @throws Error (misuse) naming the field
  void validate() const;
};

/// What a pinhole camera measures of a point: where it appears and, where `sigma_depth` is finite,
/// how far along the optical axis it is.
struct PointMeasurement {
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();  ///< undistorted
  double depth_m = 0.0;                             ///< 0: not measured
  double sigma_pixel = 1.0;
  double sigma_depth_m = 1.0;

  bool has_depth() const { return depth_m > 0.0; }
};

/// Residuals (u, v, depth), each divided by its standard deviation, with the derivative by the point
/// in camera coordinates. The third is zero where depth is not measured.
struct PointResidual {
  Eigen::Vector3d value = Eigen::Vector3d::Zero();
  Eigen::Matrix3d by_x_in_camera = Eigen::Matrix3d::Zero();

  double squared_pixel() const { return value.head<2>().squaredNorm(); }
  double squared_depth() const { return value.z() * value.z(); }
};

/// Nearer than this a point is taken to be behind the camera.
inline constexpr double kNearestDepth = 0.05;

/// @param x_in_camera at least kNearestDepth before the camera
inline PointResidual point_residual(const Pinhole& pinhole, const PointMeasurement& measured,
                                    const Eigen::Vector3d& x_in_camera) {
  PointResidual residual;
  const double inverse = 1.0 / x_in_camera.z();
  residual.value.head<2>() = (pinhole.project(x_in_camera) - measured.pixel) / measured.sigma_pixel;
  const double fx = pinhole.fx * inverse / measured.sigma_pixel;
  const double fy = pinhole.fy * inverse / measured.sigma_pixel;
  residual.by_x_in_camera.row(0) << fx, 0.0, -fx * x_in_camera.x() * inverse;
  residual.by_x_in_camera.row(1) << 0.0, fy, -fy * x_in_camera.y() * inverse;
  if (measured.has_depth()) {
    residual.value.z() = (x_in_camera.z() - measured.depth_m) / measured.sigma_depth_m;
    residual.by_x_in_camera(2, 2) = 1.0 / measured.sigma_depth_m;
  }
  return residual;
}

/// The measurement that a keypoint is.
class SensorModel {
 public:
  SensorModel(const SensorNoise& noise, const Pinhole& pinhole, std::vector<double> octave_scales);

  const SensorNoise& noise() const { return noise_; }
  const Pinhole& pinhole() const { return pinhole_; }
  double scale(int octave) const { return octave_scales_[static_cast<std::size_t>(octave)]; }
  int octaves() const { return static_cast<int>(octave_scales_.size()); }
  /// The octave, not rounded, whose pixels are so many times the size of the image's.
  double octave_of(double size) const {
    return std::log(size) / std::log(octaves() > 1 ? scale(1) : 2.0);
  }
  double sigma_pixel(const Keypoint& keypoint) const {
    // Where the patch was cut is exact by definition, but for what interpolation makes of it.
    constexpr double kReference = 0.05;
    const double of_octave = keypoint.source == PixelSource::kPatch    ? noise_.aligned_pixel
                             : keypoint.source == PixelSource::kCorner ? noise_.pixel
                                                                       : kReference;
    return of_octave * scale(keypoint.octave);
  }
  double sigma_depth_m(double depth_m) const {
    return noise_.depth_floor_m + noise_.depth_quadratic * depth_m * depth_m;
  }
  PointMeasurement measurement(const Keypoint& keypoint) const;

 private:
  SensorNoise noise_;
  Pinhole pinhole_;
  std::vector<double> octave_scales_;
};

}  // namespace cairn
