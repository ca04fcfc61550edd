// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <string_view>
#include <vector>

#include "cairn/geometry/similarity3.hpp"
#include "cairn/map/landmark_map.hpp"

namespace cairn {

/// Attributes of points that depend on the frame, recognised by their names as point clouds have them: "nx" or
/// "normal_x", in upper or lower case.
struct TurningColumns {
  std::vector<std::array<std::size_t, 3>> vectors;  ///< indices of x, y and z of normals
  /// Gaussian splats have rotations and spherical harmonics, which Cairn cannot turn.
  bool are_splats = false;
};

TurningColumns turning_columns(std::span<const std::string_view> names);

/// @throws Error (input) naming `name` if the map has the columns of Gaussian splats
void require_no_splats(const LandmarkMap& map, std::string_view name);

/// Named columns in another frame: turns normals and copies all others.
/// @throws Error (input) for Gaussian splats, unless only their place changes
std::vector<NamedColumn> transformed_columns(std::span<const NamedColumn> columns,
                                             const Similarity3& new_from_old);

}  // namespace cairn
