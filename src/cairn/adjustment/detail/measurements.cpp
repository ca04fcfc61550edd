// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/adjustment/detail/measurements.hpp"

#include <algorithm>
#include <cmath>
#include <string_view>

#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/core/statistics.hpp"
#include "cairn/map/operations.hpp"

namespace cairn::detail {
namespace {

constexpr double kMedianOfTwo = 1.386294361;  // of chi² with two degrees of freedom
constexpr double kMedianOfOne = 0.454936423;
constexpr std::size_t kFewestResiduals = 100;  // for a meaningful median

// Factor of a standard deviation.
double factor(std::vector<double>& squared, double expected_median) {
  if (squared.size() < kFewestResiduals) return 1.0;
  // Not zero: simulated observations may be exact.
  return std::max(1e-6, std::sqrt(upper_median(squared) / expected_median));
}

// Squared residuals divided by their variances, corrected for the fitted landmark.
struct Residuals {
  std::vector<double> pixels;
  std::vector<double> depths;
};

// @param fewest least number of a landmark's observations; at least 2
Residuals residuals_of(const LandmarkMap& map,
                       const std::vector<std::vector<Measurement>>& measurements,
                       std::size_t fewest) {
  Residuals residuals;
  for (std::size_t l = 0; l < measurements.size(); ++l) {
    if (measurements[l].size() < fewest) continue;
    double rows = 0.0;
    for (const Measurement& one : measurements[l]) rows += one.depth ? 3.0 : 2.0;
    constexpr double kUnknowns = 3.0;
    const double fitted = rows / (rows - kUnknowns);
    for (const Measurement& one : measurements[l]) {
      const auto squared = squared_residuals(map, one, map.landmarks().positions[l]);
      if (!squared) continue;
      residuals.pixels.push_back(fitted * squared->pixel);
      if (one.depth) residuals.depths.push_back(fitted * squared->depth);
    }
  }
  return residuals;
}

}  // namespace

std::string measurement_defect(const LandmarkMap& map) {
  if (!map.has_observations()) return "has no observations";
  const FrameTable& frames = map.frames();
  for (const FrameIndex frame : map.observations().frames) {
    if (frames.cameras.empty() || !frames.cameras[frame.value]) {
      return fmt::format("frame {} has no camera", frames.ids[frame.value].value);
    }
  }
  return {};
}

std::vector<std::vector<Measurement>> measurements_of(const LandmarkMap& map,
                                                      const MeasurementNoise& noise) {
  const std::string defect = measurement_defect(map);
  reject_if(!defect.empty(), "map", defect,
            "a map with observations, and a camera for every frame that makes them");
  const FrameTable& frames = map.frames();
  const ObservationTable& table = map.observations();
  std::vector<Rigid3> camera_from_world;
  for (std::uint32_t i = 0; i < map.frame_count(); ++i) {
    camera_from_world.push_back(map.world_from_camera(FrameIndex{i}).inverse());
  }
  std::vector<std::vector<Measurement>> result(map.landmark_count());
  for (std::size_t l = 0; l < result.size(); ++l) {
    for (std::uint64_t k = table.offsets[l]; k < table.offsets[l + 1]; ++k) {
      const FrameIndex frame = table.frames[k];
      const bool seen_before =
          std::any_of(result[l].begin(), result[l].end(),
                      [&](const Measurement& other) { return other.frame == frame; });
      const Camera& camera = map.cameras()[frames.cameras[frame.value]->value];
      const Eigen::Vector3d x_in_camera =
          camera_from_world[frame.value] * map.landmarks().positions[l];
      const auto at = project(camera, x_in_camera);
      if (seen_before || !at || !std::isfinite(at->u) || !std::isfinite(at->v)) continue;
      Measurement measurement;
      measurement.frame = frame;
      measurement.pixel = {table.pixels[k].u, table.pixels[k].v};
      measurement.sigma_px =
          noise.sigma_px(table.octaves.empty() ? 0 : table.octaves[k].value_or(0));
      const bool in_metres = map.info().length_unit == LengthUnit::kMetres;
      const bool has_depth = !table.depths.empty() && table.depths[k] && *table.depths[k] > 0.0;
      if (in_metres && has_depth && x_in_camera.z() > 0.0) {
        measurement.depth = table.depths[k];
        measurement.sigma_depth = noise.sigma_depth(*measurement.depth);
      }
      result[l].push_back(measurement);
    }
  }
  return result;
}

std::optional<SquaredResiduals> squared_residuals(const LandmarkMap& map,
                                                  const Measurement& measurement,
                                                  const Eigen::Vector3d& x_in_world) {
  const Camera& camera = map.cameras()[map.frames().cameras[measurement.frame.value]->value];
  const Eigen::Vector3d x_in_camera =
      map.world_from_camera(measurement.frame).inverse() * x_in_world;
  const auto off =
      reprojection(camera, x_in_camera, {measurement.pixel.x(), measurement.pixel.y()});
  if (!off) return std::nullopt;
  SquaredResiduals squared;
  squared.pixel = off->squaredNorm() / (measurement.sigma_px * measurement.sigma_px);
  if (measurement.depth) {
    const double depth_off = (x_in_camera.z() - *measurement.depth) / measurement.sigma_depth;
    squared.depth = depth_off * depth_off;
  }
  return squared;
}

}  // namespace cairn::detail

namespace cairn {

void MeasurementNoise::validate() const {
  const auto require = [](bool holds, std::string_view field, double value,
                          std::string_view expected) {
    if (holds && std::isfinite(value)) return;
    throw Error(ErrorKind::kMisuse, fmt::format("MeasurementNoise.{}", field),
                fmt::format("{}", value), expected);
  };
  require(pixel_px > 0.0, "pixel_px", pixel_px, "a positive number of pixels");
  require(octave_scale >= 1.0 && octave_scale <= 4.0, "octave_scale", octave_scale, "1 to 4");
  require(depth_floor > 0.0, "depth_floor", depth_floor, "a positive number");
  require(depth_quadratic >= 0.0, "depth_quadratic", depth_quadratic,
          "a number that is not negative");
}

double MeasurementNoise::sigma_px(std::int32_t octave) const {
  constexpr std::int32_t kMostOctaves = 32;  // whatever a file says
  return pixel_px * std::pow(octave_scale, std::clamp(octave, -kMostOctaves, kMostOctaves));
}

MeasurementNoise estimated_noise(const LandmarkMap& map, const MeasurementNoise& start) {
  using namespace detail;
  const auto measurements = measurements_of(map, start);
  double rows = 0.0;
  for (const auto& landmark : measurements) {
    for (const Measurement& one : landmark) rows += one.depth ? 3.0 : 2.0;
  }
  // Landmarks with few observations have small residuals, because they were fitted to these. Prefers
  // landmarks with more observations if there are enough.
  Residuals residuals;
  for (const std::size_t fewest : {4, 3, 2}) {
    residuals = residuals_of(map, measurements, fewest);
    if (residuals.pixels.size() >= kFewestResiduals) break;
  }
  // Corrects for the fitted poses.
  const RigidFrames rigid = rigid_frames(map.rigs(), map.frames());
  double of_poses = 0.0;
  for (std::uint32_t i = 0; i < map.frame_count(); ++i) of_poses += rigid.leads(i) ? 6.0 : 0.0;
  const double by_poses = rows > 2.0 * of_poses ? std::sqrt(rows / (rows - of_poses)) : 1.0;
  MeasurementNoise noise = start;
  noise.pixel_px *= by_poses * factor(residuals.pixels, kMedianOfTwo);
  const double of_depth = by_poses * factor(residuals.depths, kMedianOfOne);
  noise.depth_floor *= of_depth;
  noise.depth_quadratic *= of_depth;
  return noise;
}

}  // namespace cairn
