// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "cairn/geometry/similarity3.hpp"
#include "cairn/map/landmark_map.hpp"
#include "cairn/map/splats.hpp"

namespace cairn {

/// Transforms the frame-dependent properties of points, recognised by their names in point clouds:
/// normals ("nx" or "normal_x"), and the rotations, scales and harmonics of Gaussian splats. Does
/// not transform positions.
class ColumnMotion {
 public:
  /// @param names  names of the properties
  /// @param where  prefix of the error message
  /// @throws Error (input) for splats in no known layout, unless the motion is a pure translation
  ColumnMotion(std::span<const std::string_view> names, const Similarity3& new_from_old,
               std::string_view where);

  /// Indices of the properties that change.
  const std::vector<std::size_t>& changed() const { return changed_; }

  /// Transforms one point's properties.
  /// @param row one number per name; only entries in changed() change
  void move(std::span<double> row) const;

 private:
  void move_splat(std::span<double> row) const;

  Eigen::Matrix3d rotation_;
  Eigen::Quaterniond quaternion_;
  double log_scale_;
  std::vector<std::array<std::size_t, 3>> normals_;
  std::optional<SplatColumns> splats_;
  std::vector<HarmonicsRotation> harmonics_;  // by degree, from 1
  std::vector<std::size_t> changed_;
};

/// Applies a ColumnMotion to each row of the columns.
/// @throws Error (input) as its constructor
void move_columns(std::span<NamedColumn> columns, const Similarity3& new_from_old,
                  std::string_view where);

}  // namespace cairn
