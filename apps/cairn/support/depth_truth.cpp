// SPDX-License-Identifier: BSD-3-Clause
#include "support/depth_truth.hpp"

#include <algorithm>
#include <cmath>

#include "cairn/core/detail/time_association.hpp"
#include "cairn/core/error.hpp"
#include "cairn/evaluation/covariance_calibration.hpp"
#include "cairn/vision/image.hpp"
#include "cairn/vision/sequence.hpp"

namespace cairn::cli {
namespace {

// Between the four pixels around, where they show one surface: there inverse depth is linear.
std::optional<double> depth_between_pixels(const StoredDepthImage& depth, const Pixel& at) {
  const int x = static_cast<int>(std::floor(at.u));
  const int y = static_cast<int>(std::floor(at.v));
  if (x < 0 || y < 0 || x + 1 >= static_cast<int>(depth.width) ||
      y + 1 >= static_cast<int>(depth.height)) {
    return std::nullopt;
  }
  const double right = at.u - x;
  const double down = at.v - y;
  double inverse = 0.0;
  double nearest = 1e9;
  double farthest = 0.0;
  for (int row = 0; row < 2; ++row) {
    for (int column = 0; column < 2; ++column) {
      const double z =
          depth.at(static_cast<std::size_t>(x + column), static_cast<std::size_t>(y + row));
      if (z <= 0.0) return std::nullopt;
      nearest = std::min(nearest, z);
      farthest = std::max(farthest, z);
      inverse += (column == 1 ? right : 1.0 - right) * (row == 1 ? down : 1.0 - down) / z;
    }
  }
  constexpr double kOneSurface = 1.03;
  if (farthest > kOneSurface * nearest) return std::nullopt;
  return 1.0 / inverse;
}

}  // namespace

std::vector<std::optional<Eigen::Vector3d>> true_positions_from_depth(
    const LandmarkMap& map, const std::string& folder, double depth_units_per_metre) {
  const auto refuse = [](const std::string& what, const std::string& expected) {
    throw Error(ErrorKind::kInput, "map", what, expected);
  };
  if (map.frames().timestamps_s.empty())
    refuse("has no timestamps of its frames", "a map with timestamps");
  if (map.frames().cameras.empty()) refuse("has no cameras of its frames", "a map with cameras");
  if (!map.has_observations()) refuse("has no observations", "a map with observations");
  const RgbdSequence sequence(folder);
  std::vector<double> map_times;
  for (const auto& time : map.frames().timestamps_s) map_times.push_back(time.value_or(-1.0));
  std::vector<double> sequence_times;
  for (const SequenceFrame& frame : sequence.frames()) sequence_times.push_back(frame.timestamp_s);
  constexpr double kSameTime = 1e-3;
  std::vector<StoredDepthImage> depths(map.frame_count());
  for (const auto& [frame, at] : detail::associate_times(map_times, sequence_times, kSameTime)) {
    if (const auto& path = sequence.frames()[at].depth) depths[frame] = read_depth_image(*path);
  }

  std::vector<std::optional<Eigen::Vector3d>> positions(map.landmark_count());
  for (std::uint32_t i = 0; i < map.landmark_count(); ++i) {
    const LandmarkIndex landmark{i};
    const auto keyframe = first_keyframe(map, landmark);
    if (!keyframe || depths[keyframe->value].empty() || !map.frames().cameras[keyframe->value]) {
      continue;
    }
    const auto frames = map.observing_frames(landmark);
    const auto at = static_cast<std::size_t>(
        std::distance(frames.begin(), std::find(frames.begin(), frames.end(), *keyframe)));
    const Pixel& pixel = map.observed_pixels(landmark)[at];
    const auto depth = depth_between_pixels(depths[keyframe->value], pixel);
    const Camera& camera = map.cameras()[map.frames().cameras[keyframe->value]->value];
    const auto ray = unproject(camera, pixel);
    if (!depth || !ray || !(ray->z() > 0.0)) continue;
    positions[i] = *ray * (*depth / depth_units_per_metre / ray->z());
  }
  return positions;
}

}  // namespace cairn::cli
