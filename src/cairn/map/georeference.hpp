// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "cairn/geometry/geodetic.hpp"
#include "cairn/geometry/similarity3.hpp"
#include "cairn/map/camera.hpp"

namespace cairn {

/// Where a map is on the Earth: the similarity that takes its frame to a topocentric one. A map that is moved
/// keeps its landmarks where they are on the Earth.
struct GeoReference {
  GeodeticPosition origin;  ///< of the frame that points east, north and up (ENU)
  double scale = 1.0;       ///< metres per unit of the map, 1e-9 to 1e9
  std::array<double, 4> quaternion = {1.0, 0.0, 0.0,
                                      0.0};               ///< enu_from_map, (w, x, y, z) as stored:
                                                          ///< norm within 1e-3 of 1
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();  ///< of the map's origin, metres

  Similarity3 enu_from_map() const;
  /// The reference of the map after it was moved.
  GeoReference moved(const Similarity3& new_from_old) const;
  /// Whether the map's frame is the topocentric one, to 1e-9 in scale and angle and 1e-6 m.
  bool is_enu() const;

  GeodeticPosition geodetic(const Eigen::Vector3d& x_in_map) const;
  Eigen::Vector3d in_map(const GeodeticPosition& position) const;

  friend bool operator==(const GeoReference&, const GeoReference&) = default;
};

/// What a satellite receiver (GPS, GNSS) said of a keyframe. It does not move with the map.
struct GnssFix {
  GeodeticPosition position;
  std::optional<double> accuracy_m;  ///< standard deviation of each coordinate; positive

  friend bool operator==(const GnssFix&, const GnssFix&) = default;
};

/// A ground control point: a mark whose place on the Earth was surveyed, and the pixels where images show it. It does
/// not move with the map.
struct ControlPoint {
  struct View {
    std::string image_name;  ///< of a frame of this map or of another one; not empty
    Pixel pixel;

    friend bool operator==(const View&, const View&) = default;
  };

  std::string name;                  ///< not empty; not necessarily distinct
  double latitude_deg = 0.0;         ///< as in GeodeticPosition
  double longitude_deg = 0.0;        ///< as in GeodeticPosition
  std::optional<double> altitude_m;  ///< std::nullopt if unknown
  std::vector<View> views;

  friend bool operator==(const ControlPoint&, const ControlPoint&) = default;
};

}  // namespace cairn
