// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "cairn/core/random.hpp"
#include "cairn/map/camera.hpp"
#include "cairn/map/landmark_map.hpp"

namespace cairn::testing {

inline constexpr std::size_t kBytes = 32;  // of a descriptor

/// A point that features are found at, with what it looks like.
struct Spot {
  Eigen::Vector3d position;
  std::vector<std::uint8_t> look;
};

inline std::vector<Spot> spots_in(const Eigen::Vector3d& low, const Eigen::Vector3d& high,
                                  std::size_t count, std::uint64_t seed) {
  Random random(seed);
  std::vector<Spot> spots(count);
  for (Spot& spot : spots) {
    for (int axis = 0; axis < 3; ++axis) {
      spot.position[axis] = low[axis] + random.uniform(0.0, 1.0) * (high[axis] - low[axis]);
    }
    for (std::size_t k = 0; k < kBytes; ++k) {
      spot.look.push_back(static_cast<std::uint8_t>(random.index(256)));
    }
  }
  return spots;
}

inline std::vector<Spot> moved(std::vector<Spot> spots, const Rigid3& motion) {
  for (Spot& spot : spots) spot.position = motion * spot.position;
  return spots;
}

/// A wall 3 m off; cameras in a row before it look along z.
inline std::vector<Spot> wall() {
  return spots_in({-2.0, -1.0, 3.0}, {2.0, 1.0, 3.02}, 900, 1);
}

/// The map of a visit to spots: some of them are found, in a random order, by the cameras that see them.
inline LandmarkMap visit(const std::vector<Spot>& spots, std::uint64_t seed, double found = 0.7,
                         double shift = 0.0) {
  constexpr std::uint32_t kFrames = 8;
  constexpr double kFocal = 300.0;
  constexpr int kWidth = 640;
  constexpr int kHeight = 480;
  Random random(seed);
  MapTables tables;
  Camera camera;
  camera.model = "PINHOLE";
  camera.width = kWidth;
  camera.height = kHeight;
  camera.parameters = {kFocal, kFocal, 320.0, 240.0};
  tables.cameras.push_back(camera);
  for (std::uint32_t f = 0; f < kFrames; ++f) {
    tables.frames.ids.push_back(FrameId{f});
    tables.frames.translations.emplace_back(-0.7 + 0.2 * f + shift, 0.0, 0.0);
    tables.frames.quaternions.push_back({1.0, 0.0, 0.0, 0.0});
    tables.frames.cameras.push_back(CameraIndex{0});
  }
  DescriptorColumn looks{.kind = "ORB", .bytes_each = kBytes, .known = {}, .bytes = {}};
  tables.observations.offsets.push_back(0);
  for (const Spot& spot : spots) {
    if (random.uniform(0.0, 1.0) > found) continue;
    std::size_t seen = 0;
    const Eigen::Vector3d noise(random.normal(), random.normal(), random.normal());
    const Eigen::Vector3d position = spot.position + 0.004 * noise;
    for (std::uint32_t f = 0; f < kFrames; ++f) {
      const Eigen::Vector3d x = position - tables.frames.translations[f];
      const Pixel pixel{kFocal * x.x() / x.z() + 320.0, kFocal * x.y() / x.z() + 240.0};
      if (pixel.u < 0 || pixel.v < 0 || pixel.u > kWidth || pixel.v > kHeight) continue;
      tables.observations.frames.push_back(FrameIndex{f});
      tables.observations.pixels.push_back(pixel);
      ++seen;
    }
    if (seen == 0) continue;
    tables.landmarks.ids.push_back(LandmarkId{tables.landmarks.ids.size()});
    tables.landmarks.positions.push_back(position);
    tables.observations.offsets.push_back(tables.observations.frames.size());
    looks.known.push_back(1);
    looks.bytes.insert(looks.bytes.end(), spot.look.begin(), spot.look.end());
  }
  tables.landmarks.descriptors = std::move(looks);
  return LandmarkMap(std::move(tables));
}

inline std::vector<Spot> with(std::vector<Spot> spots, const std::vector<Spot>& more) {
  spots.insert(spots.end(), more.begin(), more.end());
  return spots;
}

inline std::vector<Spot> box_at(double x) {
  return spots_in({x, -0.1, 2.0}, {x + 0.3, 0.2, 2.1}, 80, 7);
}

}  // namespace cairn::testing
