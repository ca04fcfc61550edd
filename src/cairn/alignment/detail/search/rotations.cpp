// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/alignment/detail/search/rotations.hpp"

#include <cmath>
#include <numbers>

#include "cairn/geometry/decompositions.hpp"

namespace cairn {

std::vector<Eigen::Quaterniond> all_rotations(std::size_t count) {
  // The paper's constants: the root of 2 and the positive solution of x⁴ = x + 4.
  constexpr double kPhi = std::numbers::sqrt2;
  constexpr double kPsi = 1.533751168755204288118041;
  std::vector<Eigen::Quaterniond> rotations;
  rotations.reserve(count);
  for (std::size_t i = 0; i < count; ++i) {
    const double s = static_cast<double>(i) + 0.5;
    const double t = s / static_cast<double>(count);
    const double inner = std::sqrt(t);
    const double outer = std::sqrt(1.0 - t);
    const double alpha = 2.0 * std::numbers::pi * s / kPhi;
    const double beta = 2.0 * std::numbers::pi * s / kPsi;
    rotations.emplace_back(outer * std::cos(beta), inner * std::sin(alpha), inner * std::cos(alpha),
                           outer * std::sin(beta));
  }
  return rotations;
}

std::vector<Eigen::Quaterniond> rotations_about(const Eigen::Vector3d& from,
                                                const Eigen::Vector3d& to, std::size_t count) {
  const Eigen::Quaterniond upright = rotation_between(from, to);
  std::vector<Eigen::Quaterniond> rotations;
  rotations.reserve(count);
  for (std::size_t i = 0; i < count; ++i) {
    const double angle =
        2.0 * std::numbers::pi * static_cast<double>(i) / static_cast<double>(count);
    rotations.push_back(Eigen::AngleAxisd(angle, to.normalized()) * upright);
  }
  return rotations;
}

}  // namespace cairn
