// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/evaluation/map_consistency.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <span>

#include <fmt/format.h>

#include "cairn/core/detail/require.hpp"
#include "cairn/core/option_table.hpp"
#include "cairn/geometry/detail/grid_steps.hpp"
#include "cairn/map/camera.hpp"
#include "cairn/map/folds.hpp"
#include "cairn/map/operations.hpp"
#include "cairn/map/splats.hpp"

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

KeyframeUncertainty uncertainty_of(const Matrix6d& covariance) {
  const auto root = [](double square) { return std::sqrt(std::max(square, 0.0)); };
  return {root(covariance.diagonal().head<3>().sum()), root(covariance.diagonal().tail<3>().sum())};
}

// Landmarks beyond the first at each position.
std::size_t repeated_positions(const LandmarkMap& map, std::span<const LandmarkIndex> landmarks) {
  std::vector<std::array<double, 3>> positions;
  positions.reserve(landmarks.size());
  for (const LandmarkIndex landmark : landmarks) {
    const Eigen::Vector3d& x = map.landmarks().positions[landmark.value];
    positions.push_back({x.x(), x.y(), x.z()});
  }
  std::sort(positions.begin(), positions.end());
  const auto distinct = std::unique(positions.begin(), positions.end()) - positions.begin();
  return positions.size() - static_cast<std::size_t>(distinct);
}

// The most common covariance and how many landmarks have it.
std::size_t most_common_covariance(const LandmarkMap& map) {
  std::vector<std::array<double, 9>> covariances;
  for (std::uint32_t i = 0; i < map.landmark_count(); ++i) {
    const auto covariance = map.covariance(LandmarkIndex{i});
    if (!covariance) continue;
    auto& entry = covariances.emplace_back();
    std::copy_n(covariance->data(), 9, entry.begin());
  }
  std::sort(covariances.begin(), covariances.end());
  std::size_t most = 0;
  for (std::size_t i = 0, run = 0; i < covariances.size(); ++i) {
    run = i > 0 && covariances[i] == covariances[i - 1] ? run + 1 : 1;
    most = std::max(most, run);
  }
  return most;
}

std::size_t unobserving_frames(const LandmarkMap& map) {
  std::vector<bool> observes(map.frame_count(), false);
  for (const FrameIndex frame : map.observations().frames) observes[frame.value] = true;
  return static_cast<std::size_t>(std::count(observes.begin(), observes.end(), false));
}

std::string separate_frames_text(const LandmarkMap& map, const SeparateFrames& group) {
  return fmt::format(
      "{} images ({}) are where others are, but share {:.0f} % of the landmarks in view with them, "
      "where {:.0f} % is usual: two alike places are taken for one, and the model is folded; or a "
      "loop is not closed; or landmarks are missing, as where a model was cut",
      group.frames.size(), image_list(map, group.frames), 100.0 * group.shared,
      100.0 * group.usual);
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

std::vector<std::string> map_defects(const LandmarkMap& map) {
  std::vector<std::string> result;
  const std::size_t count = map.landmark_count();
  if (count == 0) result.emplace_back("the map has no landmarks");
  if (map.has_observations() && count > 0) {
    if (const auto none = count - landmarks_observed(map, 1).size(); none > 0) {
      result.push_back(fmt::format("landmarks without any observation: {}", none));
    }
    if (const auto idle = unobserving_frames(map); idle > 0) {
      result.push_back(fmt::format("frames that observe no landmark: {}", idle));
    }
  }
  if (!map.has_observations() && !splat_columns(map.landmarks().columns)) {
    result.emplace_back(
        "the map has no observations: confidences observations, distance, parallax and "
        "reprojection cannot be had");
  }
  const auto kept = landmarks_observed(map, 2);
  if (const auto repeated = repeated_positions(map, kept); repeated > 0) {
    result.push_back(fmt::format(
        "landmarks, observed twice or more, that lie exactly where another does: {}", repeated));
  }
  const Eigen::Vector3d grid = detail::grid_steps(map.landmarks().positions);
  if (!grid.isZero(0.0)) {
    result.push_back(fmt::format(
        "the positions lie on a grid of {:.4g} x {:.4g} x {:.4g}, as of voxels or rounded numbers: "
        "they are known to within a step only",
        grid.x(), grid.y(), grid.z()));
  }
  for (const SeparateFrames& group : separate_frames(map)) {
    result.push_back(separate_frames_text(map, group));
  }
  if (count > 0 && !map.has_covariances()) {
    result.emplace_back("the map has no covariances: confidence covariance cannot be had");
  } else if (const auto alike = most_common_covariance(map); count > 1 && alike * 2 > count) {
    result.push_back(fmt::format("landmarks that share one and the same covariance: {}", alike));
  }
  return result;
}

std::optional<KeyframeUncertainties> keyframe_uncertainties(const LandmarkMap& map) {
  const FrameTable& frames = map.frames();
  if (frames.pose_covariances.empty()) return std::nullopt;
  KeyframeUncertainties result;
  std::optional<std::size_t> before;
  for (std::size_t i = 0; i < frames.ids.size(); ++i) {
    const std::optional<Matrix6d> covariance = frames.pose_covariances[i];
    if (!covariance) continue;
    const KeyframeUncertainty here = uncertainty_of(*covariance);
    if (!before || here.angle_rad > result.of_worst.angle_rad) {
      result.worst = frames.ids[i];
      result.of_worst = here;
    }
    if (before) {
      const KeyframeUncertainty grown =
          uncertainty_of(Matrix6d(*covariance - *frames.pose_covariances[*before]));
      if (grown.angle_rad >= result.of_step.angle_rad) {
        result.step = {frames.ids[*before], frames.ids[i]};
        result.of_step = grown;
      }
    }
    before = i;
  }
  return result;
}

}  // namespace cairn
