// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "cairn/alignment/landmark_cloud.hpp"

namespace cairn {

/// Free-space check: counts of landmarks relative to what the other map's keyframes saw along the same
/// lines of sight. The space in front of a seen landmark is free.
struct SightCounts {
  std::size_t agree = 0;     ///< landmarks at the depth of what the camera saw
  std::size_t in_front = 0;  ///< landmarks in front of it, in free space: a contradiction
  std::size_t behind = 0;    ///< landmarks behind it, hidden from the camera

  std::size_t total() const { return agree + in_front + behind; }
  SightCounts& operator+=(const SightCounts& other);
};

/// Depth that the views of a cloud saw, by direction, in cells of about one degree.
///
/// A landmark of another map is compared with the depth that a view saw in its cell. Most cells are empty
/// and are not compared.
class SeenViews {
 public:
  explicit SeenViews(const LandmarkCloud& cloud);

  /// @param landmarks of the other map, moved into the cloud's frame by a pose
  SightCounts count(std::span<const Eigen::Vector3d> landmarks) const;

 private:
  struct Range {
    float least = 0.0F;
    float greatest = 0.0F;
  };
  struct View {
    Eigen::Vector3d centre;
    std::vector<std::uint16_t> slots;  // of each cell, from 1, in `ranges`; 0 if unseen
    std::vector<Range> ranges;
  };

  std::vector<View> views_;
};

}  // namespace cairn
