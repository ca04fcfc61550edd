// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "cairn/alignment/prepared_map.hpp"

namespace cairn::detail {

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

}  // namespace cairn::detail
