// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "cairn/core/ids.hpp"
#include "cairn/map/landmark_map.hpp"
#include "cairn/report/report.hpp"

namespace cairn::report {

struct MapOptions {
  std::string id = "map";
  std::string name = {};
  /// Which landmarks to show, in this order; nothing: all, in the map's order.
  std::optional<std::vector<LandmarkIndex>> landmarks = {};
};

/// The landmarks of a map with what is known of each (observations, sigma, mean distance to the cameras
/// that observed it, and the three confidences of the paper), and its frames.
///
/// Positions and, in large maps, columns are quantised: positions to 32 bits, or to 16 in maps of more
/// than 100,000 landmarks, unless outliers would make that coarser than a thousandth of where most of
/// the landmarks are. The error is at most half of Map::step (and the rounding of doubles).
/// @throws Error (misuse) for a landmark that the map does not have
Map make_map(const LandmarkMap& map, const MapOptions& options = {});

/// A unit vector upwards in the map's world frame, where the map knows its gravity.
std::optional<Eigen::Vector3d> up_of(const LandmarkMap& map);

}  // namespace cairn::report
