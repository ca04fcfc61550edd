// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/evaluation/map_consistency.hpp"

#include <algorithm>
#include <cmath>
#include <map>

#include "cairn/core/detail/require.hpp"
#include "cairn/core/option_table.hpp"
#include "cairn/map/camera.hpp"

namespace cairn {
namespace {

// Of some observations in frames with a camera.
struct Projections {
  std::vector<double> errors_px;
  std::size_t behind = 0;

  std::optional<ReprojectionStatistics> statistics(double inlier_px) const {
    const auto of_errors = statistics_of(errors_px);
    if (!of_errors) return std::nullopt;
    const auto inliers = std::count_if(errors_px.begin(), errors_px.end(),
                                       [&](double error) { return error < inlier_px; });
    return ReprojectionStatistics{
        *of_errors, static_cast<double>(inliers) / static_cast<double>(errors_px.size() + behind)};
  }
};

std::vector<Rigid3> inverse_poses(const LandmarkMap& map) {
  std::vector<Rigid3> camera_from_world(map.frame_count());
  for (std::uint32_t i = 0; i < map.frame_count(); ++i) {
    camera_from_world[i] = map.world_from_camera(FrameIndex{i}).inverse();
  }
  return camera_from_world;
}

}  // namespace

MapConsistency map_consistency(const LandmarkMap& map, double inlier_px) {
  detail::require(kFinitePositive.contains(inlier_px), "inlier_px", inlier_px, "a positive number");
  MapConsistency result;
  const ObservationTable& observations = map.observations();
  const bool has_cameras = !map.frames().cameras.empty();
  const bool has_depths = !observations.depths.empty();
  if (observations.frames.empty()) {
    result.missing_for_reprojection = result.missing_for_depth = "observations";
    return result;
  }
  if (!has_cameras) result.missing_for_reprojection = "cameras of its frames";
  if (!has_depths) result.missing_for_depth = "depths of its observations";

  if (has_cameras) result.reprojection_px.resize(observations.frames.size());
  if (has_depths) result.depth_errors.resize(observations.frames.size());
  const std::vector<Rigid3> camera_from_world = inverse_poses(map);
  Projections all;
  std::map<std::int32_t, Projections> by_octave;
  std::vector<double> depth_errors;
  double depth_sum = 0.0;

  const auto add_pixel = [&](std::uint64_t i, const Camera& camera, const Eigen::Vector3d& x) {
    const auto off = reprojection(camera, x, observations.pixels[i]);
    Projections* octave = nullptr;
    if (!observations.octaves.empty() && observations.octaves[i]) {
      octave = &by_octave[*observations.octaves[i]];
    }
    if (!off) {
      ++all.behind;
      if (octave != nullptr) ++octave->behind;
      return;
    }
    const double error = off->norm();
    result.reprojection_px[i] = error;
    all.errors_px.push_back(error);
    if (octave != nullptr) octave->errors_px.push_back(error);
  };

  for (std::uint32_t landmark = 0; landmark < map.landmark_count(); ++landmark) {
    const Eigen::Vector3d& x_in_world = map.landmarks().positions[landmark];
    for (std::uint64_t i = observations.offsets[landmark]; i < observations.offsets[landmark + 1];
         ++i) {
      const std::uint32_t frame = observations.frames[i].value;
      const Eigen::Vector3d x_in_camera = camera_from_world[frame] * x_in_world;
      if (has_cameras && map.frames().cameras[frame]) {
        add_pixel(i, map.cameras()[map.frames().cameras[frame]->value], x_in_camera);
      }
      if (has_depths && observations.depths[i]) {
        const double error = *observations.depths[i] - x_in_camera.z();
        result.depth_errors[i] = error;
        depth_errors.push_back(std::abs(error));
        depth_sum += error;
      }
    }
  }
  result.observations_behind = all.behind;
  result.reprojection = all.statistics(inlier_px);
  for (const auto& [octave, projections] : by_octave) {
    if (const auto statistics = projections.statistics(inlier_px)) {
      result.by_octave.push_back({octave, *statistics});
    }
  }
  result.depth = statistics_of(depth_errors);
  if (result.depth) result.depth_bias = depth_sum / static_cast<double>(depth_errors.size());
  return result;
}

}  // namespace cairn
