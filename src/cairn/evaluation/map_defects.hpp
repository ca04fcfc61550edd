// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "cairn/map/landmark_map.hpp"

namespace cairn {

/// What is wrong with a map or missing from it, one sentence each: landmarks or frames without observations, landmarks
/// at one position or with one covariance, inputs that confidence metrics need. Needs no truth.
std::vector<std::string> map_defects(const LandmarkMap& map);

/// Root mean square error of a keyframe's pose, as the map states it.
struct KeyframeUncertainty {
  double length = 0.0;  ///< in the map's unit
  double angle_rad = 0.0;
};

/// Uncertainty of the keyframes' poses relative to the first.
struct KeyframeUncertainties {
  FrameId worst;
  KeyframeUncertainty of_worst;
  /// Consecutive keyframes between which the variance of the angle grows most.
  std::pair<FrameId, FrameId> step;
  KeyframeUncertainty of_step;
};

/// std::nullopt if the map has no pose covariances.
std::optional<KeyframeUncertainties> keyframe_uncertainties(const LandmarkMap& map);

}  // namespace cairn
