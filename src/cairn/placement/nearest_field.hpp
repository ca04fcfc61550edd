// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include <Eigen/Core>

namespace cairn {

/// A box with edges along the axes.
struct Box {
  Eigen::Vector3f low;
  Eigen::Vector3f high;
};

/// Tells in constant time which of some points is about the nearest: a grid whose every voxel knows
/// it. A point beside the nearest may be named that is at most a voxel's diagonal farther away.
///
/// O(voxels) to make, by the separable distance transform of Felzenszwalb and Huttenlocher (2012),
/// which carries along whose distance it is.
class NearestField {
 public:
  static constexpr std::uint32_t kNone = std::numeric_limits<std::uint32_t>::max();

  /// @param points outside the box are left out
  /// @param voxel  edge length; made longer where the box would take more than `most_voxels`
  NearestField(std::span<const Eigen::Vector3f> points, const Box& box, float voxel,
               std::size_t most_voxels);

  /// Index of a point near `x`; kNone if `x` is outside the box or no point is inside.
  std::uint32_t nearest(const Eigen::Vector3f& x) const {
    const Eigen::Array3f cell = (x - low_).array() * per_length_;
    // Negated, so that what is not a number is outside as well.
    if (!((cell >= 0.0F).all() && (cell < limit_).all())) return kNone;
    const Eigen::Array3i index = cell.cast<int>();
    return nearest_[static_cast<std::size_t>((index.z() * size_[1] + index.y()) * size_[0] +
                                             index.x())];
  }

 private:
  Eigen::Vector3f low_;
  float per_length_ = 0.0F;
  Eigen::Array3f limit_;
  std::array<int, 3> size_{};
  std::vector<std::uint32_t> nearest_;
};

}  // namespace cairn
