// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "cairn/geometry/rigid3.hpp"
#include "cairn/vision/detail/features.hpp"

namespace cairn::detail {

/// A pinhole camera's measurement of a point: its pixel and, if measured, its depth along the optical axis.
struct PointMeasurement {
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();  ///< undistorted
  double depth_m = 0.0;                             ///< 0: not measured
  double sigma_pixel = 1.0;
  double sigma_depth_m = 1.0;
  /// Whether the error is normal in the inverse of the depth, as that of a disparity; otherwise it is
  /// normal in the depth.
  bool inverse_depth = false;

  bool has_depth() const { return depth_m > 0.0; }
};

/// Residuals (u, v, depth), each divided by its standard deviation, with the derivative with respect to the
/// point in camera coordinates. The third residual is zero if depth is not measured.
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
    const double share = measured.inverse_depth ? measured.depth_m * inverse : 1.0;
    residual.value.z() = (x_in_camera.z() - measured.depth_m) * share / measured.sigma_depth_m;
    residual.by_x_in_camera(2, 2) = share * share / measured.sigma_depth_m;
  }
  return residual;
}

// Quantiles of chi² for squared residuals in standard deviations: two degrees of freedom for a pixel, one
// for a depth. Huber's kernel is quadratic up to 95 %; above 99 %, the noise does not explain a residual.
inline constexpr double kPixel95 = 5.991;
inline constexpr double kPixel99 = 9.210;
inline constexpr double kDepth95 = 3.841;
inline constexpr double kDepth99 = 6.635;

/// Weight of a squared residual in iteratively reweighted least squares with Huber's kernel.
inline double huber_weight(double squared, double quadratic_up_to) {
  return squared <= quadratic_up_to ? 1.0 : std::sqrt(quadratic_up_to / squared);
}

/// Measurements from keypoints.
class SensorModel {
 public:
  /// @throws Error (misuse) naming the field of the noise
  /// @param baseline_m baseline of a stereo pair; 0 with depth images
  SensorModel(const SensorNoise& noise, const Pinhole& pinhole, std::vector<double> octave_scales,
              double baseline_m = 0.0)
      : noise_(noise),
        pinhole_(pinhole),
        octave_scales_(std::move(octave_scales)),
        baseline_m_(baseline_m) {
    noise_.validate();
  }

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
  /// @param octave octave on which the disparity of a stereo pair was measured
  double sigma_depth_m(double depth_m, int octave) const {
    if (baseline_m_ > 0.0) {
      return depth_m * depth_m / (pinhole_.fx * baseline_m_) * noise_.disparity * scale(octave);
    }
    return noise_.depth_floor_m + noise_.depth_quadratic * depth_m * depth_m;
  }
  PointMeasurement measurement(const Keypoint& keypoint) const {
    return {.pixel = keypoint.pixel.cast<double>(),
            .depth_m = keypoint.depth_m,
            .sigma_pixel = sigma_pixel(keypoint),
            .sigma_depth_m = sigma_depth_m(keypoint.depth_m, keypoint.octave),
            .inverse_depth = baseline_m_ > 0.0};
  }

 private:
  SensorNoise noise_;
  Pinhole pinhole_;
  std::vector<double> octave_scales_;
  double baseline_m_;
};

}  // namespace cairn::detail
