// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstring>
#include <optional>
#include <span>

#include <Eigen/Geometry>

#include "cairn/geometry/rigid3.hpp"

namespace cairn::detail {

/// A rigid motion from RTAB-Map's 12 float32 (3×4, row-major); std::nullopt if they are all zero, which means
/// unknown, or not a rotation and a finite translation.
inline std::optional<Rigid3> pose_of_floats(std::span<const std::byte> bytes) {
  std::array<float, 12> numbers{};
  if (bytes.size() != sizeof numbers) return std::nullopt;
  std::memcpy(numbers.data(), bytes.data(), sizeof numbers);
  Eigen::Matrix3d rotation;
  Eigen::Vector3d translation;
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) {
      rotation(row, column) = double{numbers[static_cast<std::size_t>(4 * row + column)]};
    }
    translation[row] = double{numbers[static_cast<std::size_t>(4 * row + 3)]};
  }
  constexpr double kTolerance = 1e-3;
  const Eigen::Matrix3d off = rotation * rotation.transpose() - Eigen::Matrix3d::Identity();
  if (!translation.allFinite() || !(off.cwiseAbs().maxCoeff() < kTolerance) ||
      !(rotation.determinant() > 0.0)) {
    return std::nullopt;
  }
  return Rigid3(Eigen::Quaterniond(rotation).normalized(), translation);
}

}  // namespace cairn::detail
