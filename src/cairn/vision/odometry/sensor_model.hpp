// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "cairn/adjustment/pose_derivative.hpp"
#include "cairn/core/option_table.hpp"
#include "cairn/geometry/rigid3.hpp"
#include "cairn/vision/odometry/features.hpp"

namespace cairn {

/// Standard deviations of an RGB-D camera's measurements.
struct SensorNoise {
  /// Of a detected corner, in pixels of its pyramid level; positive.
  double pixel = 0.9;
  /// Of an aligned patch, relative to where it was taken; positive.
  double aligned_pixel = 0.4;
  /// Of depth z: floor + quadratic·z², in metres (structured light: Khoshelham and Elberink, Sensors 2012).
  /// Floor positive, quadratic not negative.
  double depth_floor_m = 0.001;
  double depth_quadratic = 0.002;

  static const OptionTable table;
  /// @throws Error (misuse) naming the field
  void validate() const;
};

/// A pinhole camera's measurement of a point: its pixel and, if `sigma_depth` is finite, its depth along
/// the optical axis.
struct PointMeasurement {
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();  ///< undistorted
  double depth_m = 0.0;                             ///< 0: not measured
  double sigma_pixel = 1.0;
  double sigma_depth_m = 1.0;

  bool has_depth() const { return depth_m > 0.0; }
};

/// Residuals (u, v, depth), each divided by its standard deviation, with the derivative with respect to the
/// point in camera coordinates. The third is zero if depth is not measured.
struct PointResidual {
  Eigen::Vector3d value = Eigen::Vector3d::Zero();
  Eigen::Matrix3d by_x_in_camera = Eigen::Matrix3d::Zero();

  double squared_pixel() const { return value.head<2>().squaredNorm(); }
  double squared_depth() const { return value.z() * value.z(); }
};

/// A point with a smaller depth counts as behind the camera.
inline constexpr double kNearestDepth = 0.05;

/// @param x_in_camera at least kNearestDepth in front of the camera
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

/// Measurements from keypoints.
class SensorModel {
 public:
  SensorModel(const SensorNoise& noise, const Pinhole& pinhole, std::vector<double> octave_scales);

  const SensorNoise& noise() const { return noise_; }
  const Pinhole& pinhole() const { return pinhole_; }
  double scale(int octave) const { return octave_scales_[static_cast<std::size_t>(octave)]; }
  int octaves() const { return static_cast<int>(octave_scales_.size()); }
  /// The fractional octave whose pixels are `size` times those of the image.
  double octave_of(double size) const {
    return std::log(size) / std::log(octaves() > 1 ? scale(1) : 2.0);
  }
  double sigma_pixel(const Keypoint& keypoint) const {
    // The place where the patch was taken is exact by definition, except for interpolation.
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
