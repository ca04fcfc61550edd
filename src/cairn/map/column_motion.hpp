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

/// Moves the properties of points that depend on the frame, recognised by their names as point clouds have them: normals
/// ("nx" or "normal_x"), and the rotations, scales and harmonics of Gaussian splats. Positions are not among them.
class ColumnMotion {
 public:
  /// @param names of the properties
  /// @param where  begins the message
  /// @throws Error (input) for splats in no known layout, unless only their place changes
  ColumnMotion(std::span<const std::string_view> names, const Similarity3& new_from_old,
               std::string_view where);

  /// Indices of the properties that change.
  const std::vector<std::size_t>& changed() const { return changed_; }

  /// Moves one point.
  /// @param row a number per name; reads and writes those that change
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

/// Moves the named columns of landmarks.
/// @throws Error (input) as ColumnMotion
void move_columns(std::span<NamedColumn> columns, const Similarity3& new_from_old,
                  std::string_view where);

}  // namespace cairn
