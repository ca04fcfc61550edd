// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include <Eigen/Core>

#include "cairn/geometry/rigid3.hpp"

namespace cairn {

/// A WGS 84 position on or near the Earth. Altitudes are read as heights above the ellipsoid,
/// because formats rarely state their vertical datum.
struct GeodeticPosition {
  double latitude_deg = 0.0;   ///< -90 to 90, north is positive
  double longitude_deg = 0.0;  ///< -180 to 180, east is positive
  double altitude_m = 0.0;

  friend bool operator==(const GeodeticPosition&, const GeodeticPosition&) = default;
};

/// The defect of `position`, e.g. "latitude 91 is out of range"; empty if valid.
std::string geodetic_defect(const GeodeticPosition& position);

/// ECEF coordinates in metres, from the Earth's centre: x through latitude and longitude 0, z
/// through the north pole.
Eigen::Vector3d ecef_from_geodetic(const GeodeticPosition& position);
/// The inverse; accurate to 1e-9 degrees and 1e-4 m at altitudes from -100 km to 1e9 m.
GeodeticPosition geodetic_from_ecef(const Eigen::Vector3d& ecef);

/// Pose of the topocentric frame at `origin`, metres: x east, y north, z up (ellipsoid normal).
Rigid3 ecef_from_enu(const GeodeticPosition& origin);

}  // namespace cairn
