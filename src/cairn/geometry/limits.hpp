// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <initializer_list>
#include <string>
#include <string_view>

#include <Eigen/Core>

#include "cairn/geometry/rigid3.hpp"

namespace cairn {

// Limits of all input, so that squares, sums of squares and products of a few coordinates stay finite, also
// in single precision.

/// Largest absolute value of a coordinate: of a landmark, camera centre or translation (in metres or the
/// map's unit), or of a pixel. Doubles still resolve 1e-6 there. Also the largest scale of a
/// similarity that is read; its inverse is the smallest.
inline constexpr double kLargestCoordinate = 1e9;

/// Largest variance of a coordinate: beyond it, a standard deviation exceeds kLargestCoordinate.
inline constexpr double kLargestVariance = kLargestCoordinate * kLargestCoordinate;

/// Largest magnitude of a timestamp in seconds; nanoseconds mistaken for seconds still fit.
inline constexpr double kLargestTimestamp = 1e20;

/// Constraint on coordinates, for messages.
inline constexpr std::string_view kExpectedCoordinates = "numbers from -1e9 to 1e9";

/// Why the numbers are not valid coordinates: "is not finite" or "is beyond the limit"; empty if they are.
std::string_view coordinate_defect(std::initializer_list<double> numbers);
std::string_view coordinate_defect(const Eigen::Vector3d& point);
/// The same for a pose: its translation, or a rotation that is not finite.
std::string_view coordinate_defect(const Rigid3& pose);

/// Why `covariance` is not valid for a landmark's position: as covariance_defect(), or a variance is beyond
/// kLargestVariance; empty if it is valid.
std::string landmark_covariance_defect(const Eigen::Matrix3d& covariance);

/// Whether all magnitudes are at most kLargestCoordinate.
inline bool are_coordinates(const Eigen::Vector3d& point) {
  return (point.array().abs() <= kLargestCoordinate).all();  // false for NaN
}

}  // namespace cairn
