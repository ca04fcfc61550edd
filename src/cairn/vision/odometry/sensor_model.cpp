// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/vision/odometry/sensor_model.hpp"

#include <cmath>
#include <string_view>

#include <fmt/format.h>

#include "cairn/core/error.hpp"

namespace cairn {

constexpr OptionField kSensorNoiseFields[] = {
    {"pixel", option_at<&SensorNoise::pixel>, kFinitePositive},
    {"aligned_pixel", option_at<&SensorNoise::aligned_pixel>, kFinitePositive},
    {"depth_floor_m",
     option_at<&SensorNoise::depth_floor_m>,
     {.least = 0,
      .expected = "a positive number of metres",
      .least_is = OptionRange::End::kExcluded,
      .most_is = OptionRange::End::kExcluded}},
    {"depth_quadratic",
     option_at<&SensorNoise::depth_quadratic>,
     {.least = 0,
      .expected = "a number that is not negative",
      .most_is = OptionRange::End::kExcluded}},
};
constinit const OptionTable SensorNoise::table = {"SensorNoise", kSensorNoiseFields};

void SensorNoise::validate() const {
  check_options(*this);
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
