// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/map/georeference.hpp"

#include <cmath>

namespace cairn {

Similarity3 GeoReference::enu_from_map() const {
  return {scale,
          Rigid3(Eigen::Quaterniond(quaternion[0], quaternion[1], quaternion[2], quaternion[3]),
                 translation)};
}

GeoReference GeoReference::moved(const Similarity3& new_from_old) const {
  const Similarity3 enu_from_new = enu_from_map() * new_from_old.inverse();
  const Eigen::Quaterniond q = enu_from_new.rigid().quaternion();
  return {origin, enu_from_new.scale(), {q.w(), q.x(), q.y(), q.z()}, enu_from_new.translation()};
}

bool GeoReference::is_enu() const {
  constexpr double kTolerance = 1e-9;
  constexpr double kTolerance_m = 1e-6;
  return std::abs(scale - 1.0) <= kTolerance && enu_from_map().rigid().angle() <= kTolerance &&
         translation.norm() <= kTolerance_m;
}

GeodeticPosition GeoReference::geodetic(const Eigen::Vector3d& x_in_map) const {
  return geodetic_from_ecef(ecef_from_enu(origin) * (enu_from_map() * x_in_map));
}

Eigen::Vector3d GeoReference::in_map(const GeodeticPosition& position) const {
  return enu_from_map().inverse() *
         (ecef_from_enu(origin).inverse() * ecef_from_geodetic(position));
}

}  // namespace cairn
