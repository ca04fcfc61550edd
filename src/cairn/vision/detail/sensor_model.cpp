// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/vision/detail/sensor_model.hpp"

#include <utility>

namespace cairn::detail {

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

}  // namespace cairn::detail
