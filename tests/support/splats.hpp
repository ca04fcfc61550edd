// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>
#include <fmt/format.h>

#include "cairn/core/random.hpp"
#include "cairn/map/landmark_map.hpp"
#include "cairn/map/splats.hpp"

namespace cairn::testing {

/// Number of harmonics of degrees 1 to `degree`.
inline std::size_t harmonics_each(int degree) {
  return static_cast<std::size_t>((degree + 1) * (degree + 1) - 1);
}

/// Names of columns as trainers order them.
inline std::vector<std::string> splat_names(int degree) {
  std::vector<std::string> names = {"nx", "ny", "nz"};
  const auto add = [&](const char* stem, std::size_t count) {
    for (std::size_t i = 0; i < count; ++i) names.push_back(fmt::format("{}{}", stem, i));
  };
  add("f_dc_", 3);
  add("f_rest_", 3 * harmonics_each(degree));
  names.emplace_back("opacity");
  add("scale_", 3);
  add("rot_", 4);
  return names;
}

/// Splats of any shape and colour within 1 of the origin. Their numbers fit single precision.
inline LandmarkMap random_splats(std::size_t count, int degree, std::uint64_t seed) {
  Random random(seed);
  const auto single = [&](double spread) {
    return static_cast<double>(static_cast<float>(spread * random.normal()));
  };
  MapTables tables;
  tables.info.length_unit = LengthUnit::kFree;
  LandmarkTable& landmarks = tables.landmarks;
  for (std::size_t i = 0; i < count; ++i) {
    landmarks.ids.push_back(LandmarkId{i});
    landmarks.positions.emplace_back(single(0.4), single(0.4), single(0.4));
  }
  for (const std::string& name : splat_names(degree)) {
    NamedColumn& column = landmarks.columns.emplace_back(NamedColumn{name, {}});
    const double spread = name.starts_with("f_rest") ? 0.2 : 1.0;
    for (std::size_t i = 0; i < count; ++i) column.values.push_back(single(spread));
    if (!name.starts_with("scale")) continue;
    for (std::size_t i = 0; i < count; ++i) {
      column.values.set(i, static_cast<float>(0.5 * column.values[i] - 2.5));
    }
  }
  set_splat_looks(*splat_columns(landmarks.columns), landmarks);
  return LandmarkMap(std::move(tables));
}

inline Eigen::Vector3d random_direction(Random& random) {
  return Eigen::Vector3d(random.normal(), random.normal(), random.normal()).normalized();
}

/// Harmonics of degrees 1 to 4 towards a direction, as the polynomials of textbooks.
inline std::array<double, 24> harmonic_polynomials(const Eigen::Vector3d& direction) {
  const double x = direction.x();
  const double y = direction.y();
  const double z = direction.z();
  const auto root = [](double number) { return std::sqrt(number / std::numbers::pi); };
  return {-root(3.0 / 4) * y,
          root(3.0 / 4) * z,
          -root(3.0 / 4) * x,
          root(15.0 / 4) * x * y,
          -root(15.0 / 4) * y * z,
          root(5.0 / 16) * (2 * z * z - x * x - y * y),
          -root(15.0 / 4) * x * z,
          root(15.0 / 16) * (x * x - y * y),
          -root(35.0 / 32) * y * (3 * x * x - y * y),
          root(105.0 / 4) * x * y * z,
          -root(21.0 / 32) * y * (4 * z * z - x * x - y * y),
          root(7.0 / 16) * z * (2 * z * z - 3 * x * x - 3 * y * y),
          -root(21.0 / 32) * x * (4 * z * z - x * x - y * y),
          root(105.0 / 16) * z * (x * x - y * y),
          -root(35.0 / 32) * x * (x * x - 3 * y * y),
          root(315.0 / 16) * x * y * (x * x - y * y),
          -root(315.0 / 32) * y * z * (3 * x * x - y * y),
          root(45.0 / 16) * x * y * (7 * z * z - 1),
          -root(45.0 / 32) * y * z * (7 * z * z - 3),
          root(9.0 / 256) * (35 * z * z * z * z - 30 * z * z + 3),
          -root(45.0 / 32) * x * z * (7 * z * z - 3),
          root(45.0 / 64) * (x * x - y * y) * (7 * z * z - 1),
          -root(315.0 / 32) * x * z * (x * x - 3 * y * y),
          root(315.0 / 256) * (x * x * (x * x - 3 * y * y) - y * y * (3 * x * x - y * y))};
}

/// Colour of a splat as a camera sees it that looks along the direction, 0 to 1 unless it is out of range.
inline Eigen::Vector3d color_towards(const LandmarkMap& map, int degree, std::size_t splat,
                                     const Eigen::Vector3d& direction) {
  const auto value = [&](const std::string& name) { return map.column(name)->values[splat]; };
  const std::array<double, 24> harmonics = harmonic_polynomials(direction);
  const std::size_t each = harmonics_each(degree);
  Eigen::Vector3d color;
  for (std::size_t channel = 0; channel < 3; ++channel) {
    double sum = 0.5 + std::sqrt(0.25 / std::numbers::pi) * value(fmt::format("f_dc_{}", channel));
    for (std::size_t k = 0; k < each; ++k) {
      sum += harmonics.at(k) * value(fmt::format("f_rest_{}", channel * each + k));
    }
    color[static_cast<Eigen::Index>(channel)] = sum;
  }
  return color;
}

}  // namespace cairn::testing
