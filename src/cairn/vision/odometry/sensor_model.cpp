// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/vision/odometry/sensor_model.hpp"

#include <cmath>
#include <string_view>

#include <fmt/format.h>

#include "cairn/core/error.hpp"

namespace cairn {

void SensorNoise::validate() const {
  const auto require = [](bool holds, std::string_view field, double value,
                          std::string_view expected) {
    if (holds) return;
    throw Error(ErrorKind::kMisuse, fmt::format("SensorNoise.{}", field), fmt::format("{}", value),
                expected);
  };
  require(pixel > 0.0 && std::isfinite(pixel), "pixel", pixel, "a positive number");
  require(aligned_pixel > 0.0 && std::isfinite(aligned_pixel), "aligned_pixel", aligned_pixel,
          "a positive number");
  require(depth_floor_m > 0.0 && std::isfinite(depth_floor_m), "depth_floor_m", depth_floor_m,
          "a positive number of metres");
  require(depth_quadratic >= 0.0 && std::isfinite(depth_quadratic), "depth_quadratic",
          depth_quadratic, "a number that is not negative");
}

SensorModel::SensorModel(const SensorNoise& noise, const Pinhole& pinhole,
                         std::vector<double> octave_scales)
    : noise_(noise), pinhole_(pinhole), octave_scales_(std::move(octave_scales)) {
  noise_.validate();
}

PointMeasurement SensorModel::measurement(const Keypoint& keypoint) const {
  PointMeasurement measured;
  measured.pixel = keypoint.pixel.cast<double>();
  measured.depth_m = keypoint.depth_m;
  measured.sigma_pixel = sigma_pixel(keypoint);
  measured.sigma_depth_m = sigma_depth_m(keypoint.depth_m);
  return measured;
}

}  // namespace cairn
