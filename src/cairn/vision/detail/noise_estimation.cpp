// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/vision/detail/noise_estimation.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include "cairn/core/statistics.hpp"

namespace cairn::detail {
namespace {

constexpr double kMedianOfTwo = 1.386294361;  // of chi² with two degrees of freedom
constexpr double kMedianOfOne = 0.454936423;

// Factor of a standard deviation.
double factor(std::vector<double>& squared, double expected_median) {
  constexpr std::size_t kFewest = 200;
  if (squared.size() < kFewest) return 1.0;
  return std::clamp(std::sqrt(upper_median(squared) / expected_median), 0.25, 4.0);
}

}  // namespace

SensorNoise estimated_noise(const LandmarkGraph& graph) {
  const SensorModel& sensor = graph.sensor();
  std::vector<double> corner;
  std::vector<double> aligned;
  std::vector<double> depth;
  for (const TrackedLandmark& landmark : graph.landmarks()) {
    // Landmarks with few observations have small residuals, because they were fitted to these.
    constexpr std::size_t kFewest = 4;
    if (landmark.observations.size() < kFewest) continue;
    const auto count = static_cast<double>(landmark.observations.size());
    const double fitted = count / (count - 1.0);
    for (const KeypointReference& reference : landmark.observations) {
      const Keyframe& keyframe = graph.keyframes()[reference.keyframe];
      const Keypoint& keypoint = keyframe.features.keypoints()[reference.keypoint];
      const Eigen::Vector3d x_in_camera = keyframe.world_from_camera.inverse() * landmark.position;
      if (x_in_camera.z() < kNearestDepth) continue;
      // Includes disabled depths, because the tail of the distribution would otherwise be missing.
      const PointMeasurement measured = sensor.measurement(keypoint);
      const PointResidual residual = point_residual(sensor.pinhole(), measured, x_in_camera);
      if (keypoint.source == PixelSource::kPatch) {
        aligned.push_back(fitted * residual.squared_pixel());
      } else if (keypoint.source == PixelSource::kCorner) {
        corner.push_back(fitted * residual.squared_pixel());
      }
      if (measured.has_depth()) depth.push_back(fitted * residual.squared_depth());
    }
  }
  SensorNoise noise = sensor.noise();
  // Not much smaller than the sensor's, because residuals do not show errors common to all views of a
  // landmark.
  constexpr double kLeast = 0.35;
  noise.pixel *= std::max(kLeast, factor(corner, kMedianOfTwo));
  noise.aligned_pixel *= std::max(kLeast, factor(aligned, kMedianOfTwo));
  const double depth_factor = factor(depth, kMedianOfOne);
  noise.depth_floor_m *= depth_factor;
  noise.depth_quadratic *= depth_factor;
  // Still less do they show what a window's edges and slant do to its disparity.
  constexpr double kLeastOfDisparity = 0.5;
  noise.disparity *= std::max(kLeastOfDisparity, depth_factor);
  return noise;
}

}  // namespace cairn::detail
