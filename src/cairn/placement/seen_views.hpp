// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "cairn/placement/landmark_cloud.hpp"

namespace cairn {

/// What the cameras of one map have to say of the landmarks of another: they saw through the air in
/// front of their own landmarks, and not through what those lie on.
struct SightCounts {
  std::size_t agree = 0;     ///< landmarks where a camera saw its own
  std::size_t in_front = 0;  ///< where it looked through: they cannot be there
  std::size_t behind = 0;    ///< where it could not see them, behind others

  std::size_t total() const { return agree + in_front + behind; }
  SightCounts& operator+=(const SightCounts& other);
};

/// How far the views of a cloud saw, by direction, in cells of about one degree.
///
/// A landmark of another map is compared with what a view saw in the same cell; most cells are empty, and
/// say nothing.
class SeenViews {
 public:
  explicit SeenViews(const LandmarkCloud& cloud);

  /// @param landmarks where a pose has another map's, in the cloud's frame
  SightCounts count(std::span<const Eigen::Vector3d> landmarks) const;

 private:
  struct Range {
    float least = 0.0F;
    float greatest = 0.0F;
  };
  struct View {
    Eigen::Vector3d centre;
    std::vector<std::uint16_t>
        slots;  // of each cell, from 1, in `ranges`; 0 where nothing was seen
    std::vector<Range> ranges;
  };

  std::vector<View> views_;
};

}  // namespace cairn
