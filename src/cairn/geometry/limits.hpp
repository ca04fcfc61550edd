// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <initializer_list>
#include <string>
#include <string_view>

#include <Eigen/Core>

#include "cairn/geometry/rigid3.hpp"

namespace cairn {

// What is read or handed to the library is held to these limits, so that squares, sums of squares and
// products of a few coordinates stay finite wherever they are computed, in single precision too.

/// Largest magnitude of a coordinate: of a landmark, a camera centre, the translation of a pose, in metres
/// or the map's unit, or of a pixel. Doubles still tell 1e-6 apart there. Scales of similarities that are
/// read are at most as large, and at least one over it.
inline constexpr double kLargestCoordinate = 1e9;

/// Largest variance of a coordinate: beyond it, a standard deviation exceeds kLargestCoordinate.
inline constexpr double kLargestVariance = kLargestCoordinate * kLargestCoordinate;

/// Largest magnitude of a timestamp in seconds: nanoseconds that are taken for seconds still fit.
inline constexpr double kLargestTimestamp = 1e20;

/// What was expected of coordinates, for messages.
inline constexpr std::string_view kExpectedCoordinates = "numbers from -1e9 to 1e9";

/// Why the numbers are no coordinates: "is not finite" or "is beyond the limit"; empty if they are.
std::string_view coordinate_defect(std::initializer_list<double> numbers);
std::string_view coordinate_defect(const Eigen::Vector3d& point);
/// The same of a pose: of its translation, or of a rotation that is not finite.
std::string_view coordinate_defect(const Rigid3& pose);

/// Why `covariance` is none of a landmark's position: as covariance_defect, or a variance is beyond
/// kLargestVariance; empty if it is one.
std::string landmark_covariance_defect(const Eigen::Matrix3d& covariance);

/// Whether all are numbers of at most kLargestCoordinate.
inline bool are_coordinates(const Eigen::Vector3d& point) {
  return (point.array().abs() <= kLargestCoordinate).all();  // false for NaN
}

}  // namespace cairn
