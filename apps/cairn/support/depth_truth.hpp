// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "cairn/map/landmark_map.hpp"

namespace cairn::cli {

/// True positions of a map's landmarks in their first keyframes, from the exact depth images that a
/// simulation gives: a landmark is what its first observation's pixel shows. One a landmark; nothing
/// where the depth images have no frame of that time, or another surface begins beside the pixel.
/// @param folder a sequence in TUM layout, of the camera that took the map's images
/// @throws Error (input) naming what is missing
std::vector<std::optional<Eigen::Vector3d>> true_positions_from_depth(const LandmarkMap& map,
                                                                      const std::string& folder,
                                                                      double depth_units_per_metre);

}  // namespace cairn::cli
