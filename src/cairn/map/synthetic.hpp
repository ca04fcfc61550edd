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
  std::size_t landmarks = 3000;  ///< a map; fewer only if its frames see next to nothing
  std::size_t frames = 60;       ///< keyframes a session, along a hand-held path; 1 to a million
  double pixel_noise_px = 0.7;   ///< standard deviation of an observation, each of u and v; 0 to 20
  double depth_noise_m = 0.003;  ///< standard deviation of a measured depth at 1 m; grows as z²;
                                 ///< 0 to 0.03
  double overlap = 0.6;          ///< share of a map's surface points that are the other's too, in
                                 ///< a pair; 0 to 1
  double outlier_fraction = 0.0;  ///< share of landmarks put anywhere, with a covariance that
                                  ///< does not know it; 0 to 1

  /// @throws Error (misuse) naming the field
  void validate() const;
};

/// Two sessions of one scene, each in a world frame of its own.
struct SyntheticPair {
  LandmarkMap source;
  LandmarkMap target;
  Rigid3 target_from_source;  ///< the truth
  /// Landmarks of the two maps that are one point of the scene, by source landmark; without those
  /// that are an outlier in a map.
  std::vector<std::pair<LandmarkIndex, LandmarkIndex>> shared;
};

/// One session: landmarks on the surfaces of a desk and the boxes on it, seen from cameras that
/// sweep over it. An observation is kept with the keyframe's pixel and depth; a landmark's position
/// is the weighted mean of its noisy observations and its covariance is that mean's; without noise
/// both are exact. Poses are exact. Metres, z up, in a frame named "synthetic_desk". Same seed,
/// same map; the noise changes neither scene nor paths nor which frame observes what.
LandmarkMap synthetic_map(const SyntheticOptions& options = {});

/// Two sessions of one scene with different paths and noise. The target is in the scene's frame,
/// the source in another, "synthetic_desk_source", that is turned any way and up to 3 m off.
SyntheticPair synthetic_pair(const SyntheticOptions& options = {});

}  // namespace cairn
