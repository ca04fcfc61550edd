// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include <Eigen/Core>

#include "cairn/geometry/rigid3.hpp"

namespace cairn {

/// A place on or near the Earth, on the ellipsoid of WGS 84. Altitudes are taken as heights above that ellipsoid;
/// formats rarely say which they mean.
struct GeodeticPosition {
  double latitude_deg = 0.0;   ///< -90 to 90, north is positive
  double longitude_deg = 0.0;  ///< -180 to 180, east is positive
  double altitude_m = 0.0;

  friend bool operator==(const GeodeticPosition&, const GeodeticPosition&) = default;
};

/// Why it is no place: "latitude 91 is out of range"; empty if it is one.
std::string geodetic_defect(const GeodeticPosition& position);

/// Metres from the centre of the Earth: x through latitude and longitude 0, z through the north pole.
Eigen::Vector3d ecef_from_geodetic(const GeodeticPosition& position);
/// The inverse; exact to 1e-9 degrees and 1e-4 m from 100 km below the surface to 1e9 m above it.
GeodeticPosition geodetic_from_ecef(const Eigen::Vector3d& ecef);

/// The topocentric frame at `origin`: x to the east, y to the north, z up along the ellipsoid's normal, metres.
Rigid3 ecef_from_enu(const GeodeticPosition& origin);

}  // namespace cairn
