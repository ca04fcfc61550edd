// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/geometry/geodetic.hpp"

#include <cmath>

#include <fmt/format.h>

#include "cairn/geometry/angles.hpp"
#include "cairn/geometry/limits.hpp"

namespace cairn {
namespace {

// The defining constants of WGS 84.
constexpr double kSemiMajorAxis_m = 6378137.0;
constexpr double kFlattening = 1.0 / 298.257223563;
constexpr double kEccentricitySquared = kFlattening * (2.0 - kFlattening);

// Radius of curvature in the prime vertical.
double prime_vertical_radius(double sin_latitude) {
  return kSemiMajorAxis_m / std::sqrt(1.0 - kEccentricitySquared * sin_latitude * sin_latitude);
}

}  // namespace

std::string geodetic_defect(const GeodeticPosition& position) {
  const auto defect = [](const char* name, double value, double most) {
    return std::abs(value) <= most ? std::string()  // false for NaN
                                   : fmt::format("{} {} is out of range", name, value);
  };
  std::string text = defect("latitude", position.latitude_deg, 90.0);
  if (text.empty()) text = defect("longitude", position.longitude_deg, 180.0);
  if (text.empty()) text = defect("altitude", position.altitude_m, kLargestCoordinate);
  return text;
}

Eigen::Vector3d ecef_from_geodetic(const GeodeticPosition& position) {
  const double latitude = radians(position.latitude_deg);
  const double longitude = radians(position.longitude_deg);
  const double normal = prime_vertical_radius(std::sin(latitude));
  const double from_axis = (normal + position.altitude_m) * std::cos(latitude);
  return {from_axis * std::cos(longitude), from_axis * std::sin(longitude),
          (normal * (1.0 - kEccentricitySquared) + position.altitude_m) * std::sin(latitude)};
}

GeodeticPosition geodetic_from_ecef(const Eigen::Vector3d& ecef) {
  const double from_axis = std::hypot(ecef.x(), ecef.y());
  // Each step reduces the latitude's error by a factor of more than 100.
  constexpr int kSteps = 12;
  double latitude = std::atan2(ecef.z(), from_axis * (1.0 - kEccentricitySquared));
  for (int step = 0; step < kSteps; ++step) {
    const double sine = std::sin(latitude);
    latitude =
        std::atan2(ecef.z() + kEccentricitySquared * prime_vertical_radius(sine) * sine, from_axis);
  }
  const double sine = std::sin(latitude);
  // Along the normal, which is also exact at the poles.
  const double altitude = from_axis * std::cos(latitude) + ecef.z() * sine -
                          kSemiMajorAxis_m * std::sqrt(1.0 - kEccentricitySquared * sine * sine);
  return {degrees(latitude), degrees(std::atan2(ecef.y(), ecef.x())), altitude};
}

Rigid3 ecef_from_enu(const GeodeticPosition& origin) {
  const double latitude = radians(origin.latitude_deg);
  const double longitude = radians(origin.longitude_deg);
  const Eigen::Vector3d east(-std::sin(longitude), std::cos(longitude), 0.0);
  const Eigen::Vector3d up(std::cos(latitude) * std::cos(longitude),
                           std::cos(latitude) * std::sin(longitude), std::sin(latitude));
  Eigen::Matrix3d rotation;
  rotation << east, up.cross(east), up;
  return {rotation, ecef_from_geodetic(origin)};
}

}  // namespace cairn
