// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cstdint>
#include <utility>
#include <vector>

#include "cairn/core/random.hpp"
#include "cairn/map/synthetic.hpp"

namespace cairn::testing {

inline SyntheticOptions small_scene(std::uint64_t seed, double pixel_noise_px,
                                    double depth_noise_m) {
  SyntheticOptions options;
  options.seed = seed;
  options.landmarks = 300;
  options.frames = 20;
  options.pixel_noise_px = pixel_noise_px;
  options.depth_noise_m = depth_noise_m;
  return options;
}

inline LandmarkMap monocular(LandmarkMap map) {
  MapTables tables = std::move(map).tables();
  tables.observations.depths.clear();
  tables.info.length_unit = LengthUnit::kFree;
  return LandmarkMap(std::move(tables));
}

/// All poses but the first and all landmarks are moved, by about so many metres (and radians).
inline LandmarkMap disturbed(LandmarkMap map, double size) {
  Random random(77);
  MapTables tables = std::move(map).tables();
  for (std::size_t i = 1; i < tables.frames.ids.size(); ++i) {
    const auto& q = tables.frames.quaternions[i];
    Vector6d step;
    for (int k = 0; k < 6; ++k) step[k] = size * random.normal() / (k < 3 ? 1.0 : 3.0);
    const Rigid3 pose =
        Rigid3(Eigen::Quaterniond(q[0], q[1], q[2], q[3]), tables.frames.translations[i])
            .perturbed(step);
    const Eigen::Quaterniond moved = pose.quaternion();
    tables.frames.translations[i] = pose.translation();
    tables.frames.quaternions[i] = {moved.w(), moved.x(), moved.y(), moved.z()};
  }
  for (Eigen::Vector3d& position : tables.landmarks.positions) {
    for (int k = 0; k < 3; ++k) position[k] += size * random.normal();
  }
  return LandmarkMap(std::move(tables));
}

/// The frame farthest from the first.
inline std::size_t farthest_frame(const LandmarkMap& map) {
  const auto& centres = map.frames().translations;
  const auto farther = [&](const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
    return (a - centres[0]).norm() < (b - centres[0]).norm();
  };
  return static_cast<std::size_t>(std::max_element(centres.begin(), centres.end(), farther) -
                                  centres.begin());
}

/// The map scaled about its first frame so that the frame which is farthest in `like` is as far.
inline LandmarkMap scaled_like(LandmarkMap map, const LandmarkMap& like) {
  const std::size_t frame = farthest_frame(like);
  const auto& centres = like.frames().translations;
  MapTables tables = std::move(map).tables();
  const Eigen::Vector3d origin = tables.frames.translations[0];
  const double scale =
      (centres[frame] - centres[0]).norm() / (tables.frames.translations[frame] - origin).norm();
  for (auto* const points : {&tables.frames.translations, &tables.landmarks.positions}) {
    for (Eigen::Vector3d& x : *points) x = origin + scale * (x - origin);
  }
  return LandmarkMap(std::move(tables));
}

inline std::vector<double> errors(const LandmarkMap& map, const LandmarkMap& truth) {
  std::vector<double> result;
  for (std::size_t i = 0; i < map.landmark_count(); ++i) {
    if (map.observation_count(LandmarkIndex{static_cast<std::uint32_t>(i)}) < 2) continue;
    result.push_back((map.landmarks().positions[i] - truth.landmarks().positions[i]).norm());
  }
  return result;
}

inline double largest_error(const LandmarkMap& map, const LandmarkMap& truth) {
  const std::vector<double> all = errors(map, truth);
  return *std::max_element(all.begin(), all.end());
}

inline double median_error(const LandmarkMap& map, const LandmarkMap& truth) {
  std::vector<double> all = errors(map, truth);
  std::nth_element(all.begin(), all.begin() + static_cast<std::ptrdiff_t>(all.size() / 2),
                   all.end());
  return all[all.size() / 2];
}

}  // namespace cairn::testing
