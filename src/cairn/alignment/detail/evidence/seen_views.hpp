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

/// Depths that the views of a cloud saw, by direction, in cells of about one degree.
///
/// A landmark of another map is compared with the depths that a view saw in the landmark's cell. Most cells are empty
/// and are not compared.
class SeenViews {
 public:
  explicit SeenViews(const LandmarkCloud& cloud);

  /// @param landmarks landmarks of the other map, moved into the cloud's frame by a pose
  SightCounts count(std::span<const Eigen::Vector3d> landmarks) const;

  /// Numbers of landmarks, each classified by the majority of its lines of sight. A line of sight into the ball is not
  /// compared, because whatever is in the ball hides what is behind it.
  /// @param cloud cloud from which the views were made
  SightCounts count_around(const Ball& ball, std::span<const Eigen::Vector3d> landmarks,
                           const LandmarkCloud& cloud) const;

 private:
  struct Range {
    float least = 0.0F;
    float greatest = 0.0F;
  };
  struct View {
    Eigen::Vector3d centre;
    std::vector<std::uint16_t> slots;  // per cell: its number in `ranges`, from 1; 0 if unseen
    std::vector<Range> ranges;
  };

  // Class of a landmark at the end of the ray, as a member of SightCounts; nullptr if the view does not show it.
  using Sight = std::size_t SightCounts::*;
  static Sight sight_of(const View& view, const Eigen::Vector3d& ray);

  std::vector<View> views_;
};

}  // namespace cairn::detail
