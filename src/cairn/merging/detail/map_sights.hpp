// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "cairn/geometry/similarity3.hpp"
#include "cairn/map/camera.hpp"
#include "cairn/map/landmark_map.hpp"

namespace cairn::detail {

/// Ranges at which the keyframes of a map saw landmarks, by direction.
class MapSights {
 public:
  /// Keyframes without a camera are left out. The map must outlive the sights.
  MapSights(const LandmarkMap& map, const Similarity3& world_from_map);

  struct Count {
    std::size_t views = 0;    ///< in which the point would be visible
    std::size_t agrees = 0;   ///< of these: a landmark is seen where the point is
    std::size_t through = 0;  ///< of these: landmarks are seen behind the point, and none at it
  };

  /// @param point     in the world
  /// @param tolerance by which ranges along one direction may differ, in the world's unit, beside 4 %
  /// @param accepts   whether a view counts, by the vector from the point to its camera
  template <class Accepts>
  Count count(const Eigen::Vector3d& point, double tolerance, const Accepts& accepts) const {
    Count count;
    for (const View& view : views_) {
      if (accepts(Eigen::Vector3d(view.centre - point))) add(sight(view, point, tolerance), count);
    }
    return count;
  }

 private:
  enum class Sight { kNone, kHidden, kOpen, kAgrees, kThrough };

  struct Range {
    std::int64_t cell = 0;  // of the direction
    double range = 0.0;     // in the world's unit
  };

  struct View {
    Similarity3 camera_from_world;
    Eigen::Vector3d centre = Eigen::Vector3d::Zero();
    std::uint32_t camera = 0;
    Intrinsics intrinsics;
    double unit = 1.0;          // units of the world per unit of the camera
    std::vector<Range> ranges;  // by ascending cell

    // In focal lengths from the principal point.
    Eigen::Vector2d on_plane(const Pixel& pixel) const;
  };

  Sight sight(const View& view, const Eigen::Vector3d& point, double tolerance) const;
  static void add(Sight sight, Count& count);

  const LandmarkMap& map_;
  std::vector<View> views_;
};

}  // namespace cairn::detail
