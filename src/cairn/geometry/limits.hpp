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

/// Largest absolute coordinate of a landmark, camera centre or translation (in metres or the map's
/// unit), or of a pixel. Doubles still resolve 1e-6 at this value. Also the largest scale of an
/// input similarity; the smallest is the reciprocal.
inline constexpr double kLargestCoordinate = 1e9;

/// Largest variance of a coordinate: beyond it, a standard deviation exceeds kLargestCoordinate.
inline constexpr double kLargestVariance = kLargestCoordinate * kLargestCoordinate;

/// Largest magnitude of a timestamp in seconds; nanoseconds mistaken for seconds still fit.
inline constexpr double kLargestTimestamp = 1e20;

/// Constraint on coordinates, for messages.
inline constexpr std::string_view kExpectedCoordinates = "numbers from -1e9 to 1e9";

/// The defect of the coordinates: "is not finite" or "is beyond the limit"; empty if valid.
std::string_view coordinate_defect(std::initializer_list<double> numbers);
std::string_view coordinate_defect(const Eigen::Vector3d& point);
/// The defect of a pose's translation, or of a rotation that is not finite.
std::string_view coordinate_defect(const Rigid3& pose);

/// The defect of a landmark position's covariance: as covariance_defect(), or a variance beyond
/// kLargestVariance; empty if valid.
std::string landmark_covariance_defect(const Eigen::Matrix3d& covariance);

/// Whether all magnitudes are at most kLargestCoordinate.
inline bool are_coordinates(const Eigen::Vector3d& point) {
  return (point.array().abs() <= kLargestCoordinate).all();  // false for NaN
}

}  // namespace cairn
