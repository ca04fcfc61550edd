// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/map/splats.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numbers>
#include <string>
#include <unordered_map>
#include <utility>

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <fmt/format.h>

#include "cairn/core/text.hpp"
#include "cairn/geometry/limits.hpp"

namespace cairn {
namespace {

class PlainNames {
 public:
  explicit PlainNames(std::span<const std::string_view> names) {
    for (std::size_t i = 0; i < names.size(); ++i) places_.emplace(plain_column_name(names[i]), i);
  }

  // Places of "stem0", "stem1" and so on, as far as there are any.
  std::vector<std::size_t> numbered(std::string_view stem) const {
    std::vector<std::size_t> places;
    for (;;) {
      const auto found = places_.find(fmt::format("{}{}", stem, places.size()));
      if (found == places_.end()) return places;
      places.push_back(found->second);
    }
  }
  std::optional<std::size_t> find(const std::string& name) const {
    const auto found = places_.find(name);
    return found == places_.end() ? std::nullopt : std::optional(found->second);
  }

 private:
  std::unordered_map<std::string, std::size_t> places_;
};

// Even directions: a spiral of Fibonacci.
std::vector<Eigen::Vector3d> directions_on_sphere(int count) {
  std::vector<Eigen::Vector3d> directions;
  const double turn = std::numbers::pi * (3.0 - std::sqrt(5.0));
  for (int i = 0; i < count; ++i) {
    const double z = 1.0 - (2.0 * i + 1.0) / count;
    const double radius = std::sqrt(1.0 - z * z);
    directions.emplace_back(radius * std::cos(turn * i), radius * std::sin(turn * i), z);
  }
  return directions;
}

std::uint8_t channel_of(double coefficient) {
  const double of_constant = 0.5 / std::sqrt(std::numbers::pi);  // the harmonic of degree 0
  return static_cast<std::uint8_t>(
      std::lround(255.0 * std::clamp(0.5 + of_constant * coefficient, 0.0, 1.0)));
}

}  // namespace

std::string plain_column_name(std::string_view name) {
  std::string plain = lower_case(name);
  std::erase(plain, '_');
  return plain;
}

std::vector<std::size_t> SplatColumns::all() const {
  std::vector<std::size_t> indices = {opacity};
  const auto append = [&](const auto& more) {
    indices.insert(indices.end(), more.begin(), more.end());
  };
  append(rotation);
  append(log_scales);
  if (base_color) append(*base_color);
  append(harmonics);
  return indices;
}

std::optional<SplatColumns> splat_columns(std::span<const std::string_view> names) {
  const PlainNames plain(names);
  SplatColumns columns;
  const std::vector<std::size_t> rotation = plain.numbered("rot");
  const std::vector<std::size_t> base = plain.numbered("fdc");
  const auto opacity = plain.find("opacity");
  columns.log_scales = plain.numbered("scale");
  columns.harmonics = plain.numbered("frest");
  const auto of_degree = [](int degree) {
    return static_cast<std::size_t>(3 * ((degree + 1) * (degree + 1) - 1));
  };
  while (columns.degree < kMostSplatDegree &&
         of_degree(columns.degree) < columns.harmonics.size()) {
    ++columns.degree;
  }
  if (rotation.size() != 4 || !opacity || columns.log_scales.size() < 2 ||
      columns.log_scales.size() > 3 || (base.size() != 3 && !base.empty()) ||
      columns.harmonics.size() != of_degree(columns.degree)) {
    return std::nullopt;
  }
  std::copy(rotation.begin(), rotation.end(), columns.rotation.begin());
  columns.opacity = *opacity;
  if (!base.empty()) columns.base_color = {base[0], base[1], base[2]};
  return columns;
}

std::optional<SplatColumns> splat_columns(std::span<const NamedColumn> columns) {
  return splat_columns(column_names(columns));
}

bool has_splat_names(std::span<const std::string_view> names) {
  const PlainNames plain(names);
  return plain.find("rot0") || plain.find("frest0");
}

Harmonics harmonics_towards(const Eigen::Vector3d& direction) {
  Harmonics values;
  // (x + iy)^m, and the normalised P_m^m without its factor (1 - z²)^(m/2).
  double real = 1.0;
  double imaginary = 0.0;
  double first = 0.5 / std::sqrt(std::numbers::pi);
  for (int m = 0; m <= kMostSplatDegree; ++m) {
    // The same of P_l^m, by the recurrence over l.
    double before = 0.0;
    double now = first * (m == 0 ? 1.0 : std::numbers::sqrt2);
    double inverse_factor = 0.0;
    for (int l = m; l <= kMostSplatDegree; ++l) {
      if (l > 0) {
        values[l * l - 1 + l + m] = now * real;
        if (m > 0) values[l * l - 1 + l - m] = now * imaginary;
      }
      const double factor = std::sqrt((4.0 * (l + 1) * (l + 1) - 1.0) /
                                      static_cast<double>((l + 1) * (l + 1) - m * m));
      const double next = factor * (direction.z() * now - inverse_factor * before);
      before = std::exchange(now, next);
      inverse_factor = 1.0 / factor;
    }
    first *= -std::sqrt((2.0 * m + 3.0) / (2.0 * m + 2.0));
    const double turned = real * direction.x() - imaginary * direction.y();
    imaginary = real * direction.y() + imaginary * direction.x();
    real = turned;
  }
  return values;
}

std::vector<HarmonicsRotation> harmonics_rotation(int degree, const Eigen::Matrix3d& rotation) {
  constexpr int kDirections =
      64;  // more than harmonics, so that the equations are well conditioned
  const std::vector<Eigen::Vector3d> directions = directions_on_sphere(kDirections);
  std::vector<HarmonicsRotation> matrices;
  using AllHarmonics = Eigen::Matrix<double, Eigen::Dynamic, Harmonics::SizeAtCompileTime>;
  AllHarmonics all_now(kDirections, AllHarmonics::ColsAtCompileTime);
  AllHarmonics all_before(kDirections, AllHarmonics::ColsAtCompileTime);
  for (int i = 0; i < kDirections; ++i) {
    const Eigen::Vector3d& towards = directions[static_cast<std::size_t>(i)];
    all_now.row(i) = harmonics_towards(towards).transpose();
    all_before.row(i) = harmonics_towards(rotation.transpose() * towards).transpose();
  }
  for (int l = 1; l <= degree; ++l) {
    const Eigen::MatrixXd now = all_now.middleCols(l * l - 1, 2 * l + 1);
    const Eigen::MatrixXd before = all_before.middleCols(l * l - 1, 2 * l + 1);
    matrices.emplace_back((now.transpose() * now).ldlt().solve(now.transpose() * before));
  }
  return matrices;
}

void set_splat_looks(const SplatColumns& columns, LandmarkTable& landmarks) {
  const auto value = [&](std::size_t column, std::size_t i) {
    return landmarks.columns[column].values[i];
  };
  const std::size_t count = landmarks.positions.size();
  landmarks.covariances.resize(count);
  for (std::size_t i = 0; i < count; ++i) {
    const auto& [w, x, y, z] = columns.rotation;
    const Eigen::Quaterniond q(value(w, i), value(x, i), value(y, i), value(z, i));
    Eigen::Vector3d variances = Eigen::Vector3d::Zero();
    for (std::size_t k = 0; k < columns.log_scales.size(); ++k) {
      variances[static_cast<Eigen::Index>(k)] = std::exp(2.0 * value(columns.log_scales[k], i));
    }
    const Eigen::Matrix3d rotation = q.normalized().toRotationMatrix();
    Eigen::Matrix3d& covariance = landmarks.covariances[i];
    covariance = rotation * variances.asDiagonal() * rotation.transpose();
    covariance = 0.5 * (covariance + covariance.transpose()).eval();
    if (!landmark_covariance_defect(covariance).empty()) {
      covariance.setConstant(std::numeric_limits<double>::quiet_NaN());
    }
  }
  if (!columns.base_color) return;
  landmarks.colors.resize(count, Color{});
  for (std::size_t i = 0; i < count; ++i) {
    const auto& [red, green, blue] = *columns.base_color;
    const Eigen::Vector3d color(value(red, i), value(green, i), value(blue, i));
    if (color.allFinite()) {
      landmarks.colors[i] =
          Color{channel_of(color.x()), channel_of(color.y()), channel_of(color.z())};
    } else {
      landmarks.colors[i].reset();
    }
  }
}

std::vector<double> splat_opacities(const SplatColumns& columns, const LandmarkTable& landmarks) {
  const ColumnValues& values = landmarks.columns[columns.opacity].values;
  std::vector<double> opacities(values.begin(), values.end());
  for (double& opacity : opacities) {
    opacity = std::isnan(opacity) ? 0.0 : 1.0 / (1.0 + std::exp(-opacity));
  }
  return opacities;
}

}  // namespace cairn
