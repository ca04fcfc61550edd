// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "cairn/alignment/prepared_map.hpp"

namespace cairn::detail {

struct Ball {
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  double radius = 0.0;

  bool contains(const Eigen::Vector3d& point) const {
    return (point - centre).squaredNorm() <= radius * radius;
  }
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

  /// Number of landmarks for which most of the lines of sight agree, and so on. A line of sight into the ball says nothing:
  /// whatever is in the ball hides what is behind it.
  /// @param cloud of the views
  SightCounts count_around(const Ball& ball, std::span<const Eigen::Vector3d> landmarks,
                           const LandmarkCloud& cloud) const;

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

  // What a view says about a landmark in this direction; nullptr: nothing.
  using Sight = std::size_t SightCounts::*;
  static Sight sight_of(const View& view, const Eigen::Vector3d& ray);

  std::vector<View> views_;
};

}  // namespace cairn::detail
