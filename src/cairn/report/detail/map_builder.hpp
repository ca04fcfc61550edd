// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "cairn/core/ids.hpp"
#include "cairn/map/landmark_map.hpp"
#include "cairn/report/report.hpp"

namespace cairn::report::detail {

struct MapOptions {
  std::string id = "map";
  std::string name = {};
  /// Landmarks to show, in this order; std::nullopt: all, in the map's order.
  std::optional<std::vector<LandmarkIndex>> landmarks = {};
  /// What the map's frames saw, e.g. from frame_images().
  std::vector<FrameImage> images = {};
};

/// The landmarks of a map with their properties (observations, sigma, mean distance to the observing
/// cameras, and the paper's three confidences), and its frames.
///
/// Positions and, in large maps, columns are quantised. Positions take 32 bits, or 16 in maps of more than
/// 100,000 landmarks, unless outliers would make that coarser than a thousandth of the extent of most
/// landmarks. The error is at most half of Map::step (and the rounding of doubles).
/// @throws Error (misuse) for a landmark that the map does not have
Map make_map(const LandmarkMap& map, const MapOptions& options = {});

/// Field of view of the first frame with a camera, with the optical axis in its middle; std::nullopt if no
/// frame has one.
std::optional<Frustum> frustum_of(const LandmarkMap& map);

/// Unit vector upwards in the map's world frame; std::nullopt if its gravity is unknown.
std::optional<Eigen::Vector3d> up_of(const LandmarkMap& map);

}  // namespace cairn::report::detail
