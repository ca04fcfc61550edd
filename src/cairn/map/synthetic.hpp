// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "cairn/core/option_table.hpp"
#include "cairn/geometry/rigid3.hpp"
#include "cairn/map/landmark_map.hpp"

namespace cairn {

/// Options of a synthetic desk-size scene and its mapping sessions.
struct SyntheticOptions {
  std::uint64_t seed = 1;
  std::size_t landmarks = 3000;  ///< per map; fewer only if its frames observe almost none
  std::size_t frames = 60;       ///< keyframes per session, along a hand-held path; 1 to a million
  double pixel_noise_px = 0.7;   ///< standard deviation of an observation, each of u and v; 0 to 20
  double depth_noise_m = 0.003;  ///< standard deviation of a measured depth at 1 m; grows as z²;
                                 ///< 0 to 0.03
  double overlap = 0.6;  ///< share of a map's surface points common to both maps of a pair; 0 to 1
  /// share of outliers, at random positions with inlier-like covariances; 0 to 1
  double outlier_fraction = 0.0;

  static const OptionTable table;
  /// @throws Error (misuse) naming the field
  void validate() const;
};

/// Two sessions of one scene, each in its own world frame.
struct SyntheticPair {
  LandmarkMap source;
  LandmarkMap target;
  Rigid3 target_from_source;  ///< ground truth
  /// Landmarks of both maps at one scene point, by ascending source landmark; without outliers.
  std::vector<std::pair<LandmarkIndex, LandmarkIndex>> shared;
};

/// One session: landmarks on the surfaces of a desk and the boxes on it, observed by cameras that
/// sweep over the desk. A landmark's position is the weighted mean of its noisy observations, with
/// the covariance of this mean; without noise, positions are exact and covariances zero. Poses are
/// exact. Metres, z up, in a frame named "synthetic_desk". The same seed gives the same map. The
/// noise does not change the scene, the paths or the observing frames of a landmark.
LandmarkMap synthetic_map(const SyntheticOptions& options = {});

/// Two sessions of one scene with different paths and noise. The target is in the scene's frame; the source
/// is in "synthetic_desk_source", rotated arbitrarily and up to 3 m away.
SyntheticPair synthetic_pair(const SyntheticOptions& options = {});

}  // namespace cairn
