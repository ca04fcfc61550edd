// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "cairn/geometry/rigid3.hpp"
#include "cairn/map/landmark_map.hpp"

namespace cairn {

/// A scene of the size of a desk, and how a session maps it.
struct SyntheticOptions {
  std::uint64_t seed = 1;
  std::size_t landmarks = 3000;   ///< about as many a map; what no frame sees is not mapped
  std::size_t frames = 60;        ///< keyframes a session, along a hand-held path
  double pixel_noise_px = 0.7;    ///< standard deviation of an observation, each of u and v
  double depth_noise_m = 0.003;   ///< standard deviation of a measured depth at 1 m; grows as z²
  double overlap = 0.6;           ///< share of the surface points that both sessions of a pair use
  double outlier_fraction = 0.0;  ///< share of landmarks put anywhere, with a covariance that
                                  ///< does not know it

  /// @throws Error (misuse) naming the field
  void validate() const;
};

/// Two sessions of one scene, each in a world frame of its own.
struct SyntheticPair {
  LandmarkMap source;
  LandmarkMap target;
  Rigid3 target_from_source;  ///< the truth
  /// Landmarks of the two maps that are one point of the scene, by source landmark.
  std::vector<std::pair<LandmarkIndex, LandmarkIndex>> shared;
};

/// One session: landmarks on the surfaces of a desk and the boxes on it, seen from cameras that
/// sweep over it. An observation is kept with the keyframe's pixel and depth; a landmark's position
/// is the weighted mean of its noisy observations and its covariance is that mean's. Same seed,
/// same map.
LandmarkMap synthetic_map(const SyntheticOptions& options = {});

/// Two sessions of one scene with different paths, noise and frames of reference.
SyntheticPair synthetic_pair(const SyntheticOptions& options = {});

}  // namespace cairn
