// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include <Eigen/Core>

namespace cairn::detail {

/// An axis-aligned box.
struct Box {
  Eigen::Vector3f low;
  Eigen::Vector3f high;
};

/// Finds an approximate nearest point in constant time: a grid stores a near point for every voxel. The
/// point found may be farther than the nearest point by at most a voxel's diagonal.
///
/// O(voxels) to build, with the separable distance transform of Felzenszwalb and Huttenlocher (2012),
/// extended by the index of the nearest point.
class NearestField {
 public:
  static constexpr std::uint32_t kNone = std::numeric_limits<std::uint32_t>::max();

  /// @param points those outside the box are ignored
  /// @param voxel  edge length; enlarged if the box would take more than `most_voxels`
  NearestField(std::span<const Eigen::Vector3f> points, const Box& box, float voxel,
               std::size_t most_voxels);

  /// Index of a point near `x`; kNone if `x` is outside the box or no point is inside.
  std::uint32_t nearest(const Eigen::Vector3f& x) const {
    const std::size_t voxel = voxel_of(x);
    return voxel == kOutside ? kNone : nearest_[voxel];
  }

 private:
  static constexpr std::size_t kOutside = std::numeric_limits<std::size_t>::max();

  std::size_t voxel_of(const Eigen::Vector3f& x) const {
    const Eigen::Array3f cell = (x - low_).array() * per_length_;
    // Negated, so that NaN counts as outside.
    if (!((cell >= 0.0F).all() && (cell < limit_).all())) return kOutside;
    const auto along = [&cell](int axis) { return static_cast<std::size_t>(cell[axis]); };
    return (along(2) * size_[1] + along(1)) * size_[0] + along(0);
  }

  Eigen::Vector3f low_;
  float per_length_ = 0.0F;
  Eigen::Array3f limit_;
  std::array<std::size_t, 3> size_{};
  std::vector<std::uint32_t> nearest_;
};

}  // namespace cairn::detail
